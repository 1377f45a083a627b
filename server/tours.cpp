#include "server/tours.h"

#include <array>
#include <cstdint>
#include <system_error>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "render_core/error.h"
#include "render_core/scene/json_field.h"
#include "render_core/scene/locate_scene.h"

namespace catgs {
namespace {

constexpr std::uint64_t max_bytes = 4 << 20;

bool is_file(const std::filesystem::path& file) {
  std::error_code error;
  return std::filesystem::is_regular_file(file, error);
}

nlohmann::json sidecar_tours(const std::filesystem::path& sidecar) {
  if (!is_file(sidecar)) return nullptr;
  const FileSource file(sidecar);
  const nlohmann::json document = read_json(file, max_bytes);
  const auto tours = JsonField(file.name(), document).find("tours");
  if (!tours) return nullptr;
  static_cast<void>(tours->elements());  // an array, or it says so
  return tours->value();
}

nlohmann::json viewer_settings(std::filesystem::path sidecar) {
  const std::array candidates = {std::filesystem::path(sidecar).replace_extension(".settings.json"),
                                 sidecar.parent_path() / "settings.json"};
  for (const auto& path : candidates) {
    if (!is_file(path)) continue;
    try {
      nlohmann::json settings = read_json(FileSource(path), max_bytes);
      // Many programs have a settings.json: the viewer's names its tracks.
      if (settings.is_object() && settings.contains("animTracks")) return settings;
    } catch (const InputError& error) {
      spdlog::warn("no tours from it: {}", error.what());
    }
  }
  return nullptr;
}

}  // namespace

std::string read_tours(const std::filesystem::path& scene) {
  const std::filesystem::path sidecar = locate_scene(scene).hints.sidecar;
  return nlohmann::json{{"tours", sidecar_tours(sidecar)}, {"settings", viewer_settings(sidecar)}}
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace catgs
