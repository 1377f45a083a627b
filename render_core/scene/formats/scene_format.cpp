#include "render_core/scene/formats/scene_format.h"

#include <algorithm>
#include <utility>

#include "render_core/base/even_sample.h"

namespace catgs {

std::shared_ptr<const FileSet> SceneFiles::open(std::string_view only) const {
  if (index.empty()) return std::make_shared<const ZipFiles>(FileSource(path), only);
  return std::make_shared<const FolderFiles>(path);
}

FileRows even_sample(std::uint64_t rows) {
  const EvenSample even(rows, most_origin_positions);
  return {0, even.size(), even.step()};
}

DecodedParts parts_of_rows(
    std::string format, std::uint64_t rows, std::uint64_t part_rows,
    const std::function<GaussianCloud(const FileRows&, const glm::dvec3& origin,
                                      const LoadContext&)>& read,
    const LoadContext& context, std::vector<std::string> notes) {
  DecodedScene sample = read_about_origin([&](const glm::dvec3& origin) -> DecodedScene {
    return {.format = {}, .cloud = read(even_sample(rows), origin, context)};
  });
  const auto read_part = [=, origin = sample.origin](std::uint64_t part,
                                                     const LoadContext& reading) {
    const std::uint64_t first = part * part_rows;
    return read({first, std::min(part_rows, rows - first)}, origin, reading);
  };
  return {std::move(format), (rows + part_rows - 1) / part_rows,
          read_part,         std::move(sample.cloud),
          std::move(notes),  sample.origin};
}

}  // namespace catgs
