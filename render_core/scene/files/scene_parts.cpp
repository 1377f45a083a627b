#include "render_core/scene/files/scene_parts.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>
#include <utility>

#include "render_core/base/error.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/files/sanitize.h"
#include "render_core/scene/formats/compressed_ply.h"
#include "render_core/scene/formats/ply.h"

namespace catgs {
namespace {

constexpr std::uint64_t sample_rows = std::uint64_t{1}
                                      << 16;  // as many as robust_bounds() looks at

/// A file whose rows are read where they are.
struct RowFile {
  explicit RowFile(const std::filesystem::path& path) : file(path), header(read_ply_header(file)) {}

  [[nodiscard]] std::uint64_t rows() const { return header.find("vertex")->count; }

  FileSource file;
  PlyHeader header;
};

/// The file, unless it is of another format.
std::shared_ptr<const RowFile> open_rows(const std::filesystem::path& path) {
  std::array<char, 3> begins{};
  {
    const FileSource file(path);
    if (file.size() < begins.size()) return nullptr;
    file.read(0, std::as_writable_bytes(std::span(begins)));
  }
  if (std::string_view(begins.data(), begins.size()) != "ply") return nullptr;
  auto open = std::make_shared<const RowFile>(path);
  const PlyElement* vertex = open->header.find("vertex");
  if (!vertex || open->header.encoding == PlyEncoding::ascii || is_compressed_ply(open->header))
    return nullptr;
  require_rows_in_file(open->file, *vertex, TreeShape::max_gaussians);
  return open;
}

}  // namespace

std::optional<PartedScene> scene_in_parts(const std::filesystem::path& path,
                                          const std::optional<glm::vec3>& up,
                                          const std::shared_ptr<ThreadPool>& pool,
                                          std::uint64_t part_rows) {
  const SceneLocation location = locate_scene(path);
  if (location.kind != SceneLocation::Kind::file) return std::nullopt;
  const std::shared_ptr<const RowFile> open = open_rows(location.path);
  if (!open) return std::nullopt;

  const LoadContext context(*pool);
  const std::uint64_t step = (open->rows() + sample_rows - 1) / sample_rows;
  GaussianCloud sample =
      read_ply_rows(open->file, open->header, {0, (open->rows() + step - 1) / step, step}, context);
  const SaneReach reach = sane_reach(sample);
  sanitize(sample, reach, context);

  PartedScene scene;
  if (!sample.empty()) scene.hints = find_hints(sample, location.hints, up, scene.notes, pool);
  scene.parts.format = "3DGS ply";
  scene.parts.each = [open, reach, pool, part_rows](const auto& take) {
    const LoadContext reading(*pool);
    std::uint64_t dropped = 0;
    for (std::uint64_t first = 0; first < open->rows(); first += part_rows) {
      GaussianCloud part = read_ply_rows(
          open->file, open->header, {first, std::min(part_rows, open->rows() - first)}, reading);
      dropped += sanitize(part, reach, reading).dropped;
      take(part);
    }
    return dropped;
  };
  return scene;
}

}  // namespace catgs
