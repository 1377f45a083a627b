#include "render_core/scene/files/scene_formats.h"

#include <algorithm>
#include <array>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "render_core/base/error.h"
#include "render_core/scene/formats/gltf.h"
#include "render_core/scene/formats/ksplat.h"
#include "render_core/scene/formats/lcc.h"
#include "render_core/scene/formats/lcc2.h"
#include "render_core/scene/formats/ply.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/splat.h"
#include "render_core/scene/formats/spz.h"
#include "render_core/scene/formats/streamed_sog.h"
#include "render_core/scene/formats/tiles.h"
#include "render_core/scene/tree/read_tree.h"

namespace catgs {
namespace {

// The content of a file decides before its name does, but an .ssog is a zip archive as a .sog is.
constexpr std::array formats = {
    &ply_format,  &streamed_sog_format, &tiles_format, &sog_format,    &spz_format,   &gltf_format,
    &lcc2_format, &lcc_format,          &tree_format,  &ksplat_format, &splat_format,
};

/// "a, b or c"
std::string any_of(const std::vector<std::string>& texts) {
  const std::span all(texts);
  return fmt::format("{} or {}", fmt::join(all.first(all.size() - 1), ", "), all.back());
}

}  // namespace

std::span<const SceneFormat* const> scene_formats() { return formats; }

const SceneFormat& format_of(const std::filesystem::path& path) {
  const FileSource file(path);
  const std::string extension = path.extension().string();
  for (const SceneFormat* format : formats)
    if (format->is_mine && format->is_mine(file, extension)) return *format;
  throw InputError(path.string(), "", "is not a scene of a known format", supported_scenes());
}

const SceneFormat* format_with(std::string_view extension) {
  const auto found = std::ranges::find_if(formats, [&](const SceneFormat* format) {
    return !extension.empty() && std::ranges::count(format->extensions, extension) > 0;
  });
  return found == formats.end() ? nullptr : *found;
}

std::string supported_scenes() {
  std::string files;
  std::vector<std::string> indices;
  for (const SceneFormat* format : formats) {
    for (const std::string_view extension : format->extensions)
      if (!extension.empty()) files += fmt::format("{}, ", extension);
    if (!format->kinds.empty()) files.insert(files.size() - 2, fmt::format(" ({})", format->kinds));
    if (!format->index.empty())
      indices.push_back(fmt::format("{} ({})", format->index, format->name));
  }
  return fmt::format("supported: {}a folder with {}, a training output folder", files,
                     any_of(indices));
}

std::string written_extensions() {
  std::vector<std::string> extensions;
  for (const SceneFormat* format : formats)
    if (format->write || format->in_pages) extensions.emplace_back(format->extensions[0]);
  return any_of(extensions);
}

}  // namespace catgs
