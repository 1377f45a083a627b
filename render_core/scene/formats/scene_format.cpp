#include "render_core/scene/formats/scene_format.h"

#include <algorithm>
#include <utility>

namespace catgs {

std::shared_ptr<const FileSet> SceneFiles::open(std::string_view only) const {
  if (index.empty()) return std::make_shared<const ZipFiles>(FileSource(path), only);
  return std::make_shared<const FolderFiles>(path);
}

DecodedParts parts_of_rows(
    std::string format, std::uint64_t rows, std::uint64_t part_rows,
    const std::function<GaussianCloud(const FileRows&, const LoadContext&)>& read,
    const LoadContext& context, std::vector<std::string> notes) {
  const std::uint64_t step = (rows + DecodedParts::most_sampled - 1) / DecodedParts::most_sampled;
  const auto read_part = [=](std::uint64_t part, const LoadContext& reading) {
    const std::uint64_t first = part * part_rows;
    return read({first, std::min(part_rows, rows - first)}, reading);
  };
  return {std::move(format), (rows + part_rows - 1) / part_rows, read_part,
          read({0, (rows + step - 1) / step, step}, context), std::move(notes)};
}

}  // namespace catgs
