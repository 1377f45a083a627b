#include "render_core/scene/tree/tree_file.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>
#include <zlib.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

void check_levels(const ByteSource& file, const TreeHeader& header) {
  const TreeShape shape(header.gaussians, static_cast<int>(header.sh_degree));
  for (int l = 0; l < shape.levels(); ++l) {
    const TreeLevel& level = header.levels[static_cast<std::size_t>(l)];
    const std::uint64_t nodes = shape.nodes_on(l);
    if (level.gaussians < nodes || level.gaussians > nodes * cluster_size ||
        !(level.mean_error >= 0.0f && level.mean_error <= level.max_error) ||
        !std::isfinite(level.max_error))
      throw InputError(file.name(), fmt::format("level {}", l), "is out of range");
  }
  if (header.levels[0].gaussians != header.gaussians)
    throw InputError(file.name(), "level 0", "has another number of Gaussians than the tree");
  for (auto l = static_cast<std::size_t>(shape.levels()); l < header.levels.size(); ++l)
    if (header.levels[l] != TreeLevel{})
      throw InputError(file.name(), fmt::format("level {}", l), "is above the root");
}

}  // namespace

std::uint32_t TreeHeader::right_checksum() const {
  return static_cast<std::uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(this), offsetof(TreeHeader, checksum)));
}

std::uint32_t TreeHeader::right_origin_checksum() const {
  if (origin == glm::dvec3(0.0)) return 0;
  return static_cast<std::uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(&origin), sizeof origin));
}

bool is_tree(const ByteSource& file) {
  std::array<char, 8> magic{};
  if (file.size() < magic.size()) return false;
  file.read(0, std::as_writable_bytes(std::span(magic)));
  return magic == TreeHeader::right_magic;
}

TreeHeader read_tree_header(const ByteSource& file) {
  TreeHeader header;
  file.read(0, std::as_writable_bytes(std::span(&header, 1)));
  const auto refuse = [&](std::string_view field, const std::string& what,
                          std::string_view remedy) {
    throw InputError(file.name(), field, what, remedy);
  };
  constexpr std::string_view damaged = "the file is damaged: convert the scene again";
  if (header.magic != TreeHeader::right_magic) refuse("magic", "is not that of a tree", "");
  if (header.version < TreeHeader::first_version || header.version > TreeHeader::right_version)
    refuse("version",
           fmt::format("{} where {} to {} are known", header.version, TreeHeader::first_version,
                       TreeHeader::right_version),
           "convert the scene again with this program");
  if (header.checksum != header.right_checksum())
    refuse("header", "its checksum is wrong", damaged);
  const bool sound = header.origin_checksum == header.right_origin_checksum();
  for (int axis = 0; axis < 3; ++axis)
    if (!sound || !(std::abs(header.origin[axis]) <= static_cast<double>(max_coordinate)))
      refuse("origin", "is damaged or out of range", damaged);
  if (header.sh_degree > max_sh_degree)
    refuse("SH degree", fmt::format("{} is not in 0 to 3", header.sh_degree), damaged);
  if (header.model > SplatModel::surfels || header.reserved != 0)
    refuse("model", "is not known", "convert the scene again with this program");
  if (header.gaussians == 0 || header.gaussians > TreeShape::max_gaussians)
    refuse("Gaussians",
           fmt::format("{} is not in 1 to {}", header.gaussians, TreeShape::max_gaussians),
           damaged);
  for (int axis = 0; axis < 3; ++axis)
    if (!(header.low[axis] >= -max_coordinate && header.low[axis] <= header.high[axis] &&
          header.high[axis] <= max_coordinate))
      refuse("bounds", "are out of range", damaged);
  if (header.dropped > header.read || header.read - header.dropped != header.gaussians)
    refuse("Gaussians read and dropped", "do not make the number of Gaussians", damaged);
  if (header.source.back() != '\0') refuse("source", "has no end", damaged);
  check_levels(file, header);
  return header;
}

TreeFile::TreeFile(std::unique_ptr<const ByteSource> file)
    : file_(std::move(file)),
      header_(read_tree_header(*file_)),
      shape_(header_.gaussians, static_cast<int>(header_.sh_degree)) {}

std::uint64_t TreeFile::pages_in_file() const {
  const std::uint64_t size = std::max<std::uint64_t>(file_->size(), TreeShape::header_bytes);
  return std::min(shape_.pages(), (size - TreeShape::header_bytes) / shape_.page_bytes());
}

std::unique_ptr<const TreePage> TreeFile::read(std::uint64_t number, const NodeFacts* above) const {
  auto page = std::make_unique<TreePage>(shape_);
  file_->read(shape_.page_offset(number), page->bytes());
  page->check(number, file_->name(), above);
  if (header_.version == TreeHeader::first_version) page->clear_sh_octaves();
  return page;
}

std::unique_ptr<const TreePage> TreeFile::page(std::uint64_t number, const NodeFacts* above) {
  try {
    return read(number, above);
  } catch (const InputError& e) {
    const std::lock_guard lock(mutex_);
    if (damaged_.empty()) first_damage_ = e.what();
    damaged_.insert(number);
    return nullptr;
  }
}

TreeFile::Damage TreeFile::damage() const {
  const std::lock_guard lock(mutex_);
  return {damaged_.size(), first_damage_};
}

}  // namespace catgs
