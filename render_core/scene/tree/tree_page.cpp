#include "render_core/scene/tree/tree_page.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include <fmt/format.h>
#include <zlib.h>

#include "render_core/base/error.h"
#include "render_core/math/camera.h"

namespace catgs {
namespace {

constexpr float largest_sh_unit = 1e3f / 127.0f * 0x1p15f;  // sanitize() allows 1000

bool finite_half(std::uint16_t bits) { return (bits & 0x7c00u) != 0x7c00u; }

/// Names the first fact of a node that is out of range; null if none is.
const char* fault_of(const NodeFacts& facts) {
  const Cluster& b = facts.bounds;
  if (facts.count < 1 || facts.count > cluster_size) return "count";
  if (!(facts.error >= 0.0f && facts.error <= max_coordinate)) return "error";
  if (!(b.reach >= 0.0f && std::isfinite(b.reach))) return "reach";
  for (int axis = 0; axis < 3; ++axis)
    if (!(std::abs(b.centre[axis]) <= max_coordinate && b.half_extent[axis] >= 0.0f &&
          b.half_extent[axis] <= 2.1f * max_coordinate))
      return "bounds";
  if (std::ranges::count(facts.reserved, 0u) != 3) return "reserved word";
  // A power of two, of which 63 octaves are still normal floats.
  int exponent = 0;
  if (!(facts.units.factor > 0.0f && std::isfinite(facts.units.factor)) ||
      std::frexp(facts.units.factor, &exponent) != 0.5f || exponent - 1 < -126 + 63)
    return "unit of the covariances";
  for (const float unit : facts.units.sh)
    if (!(unit >= 0.0f && unit <= largest_sh_unit)) return "units of the harmonics";
  return nullptr;
}

/// The same of its records. All of a record that is not looked at is in range with any bits.
const char* fault_of(const NodeFacts& facts, std::span<const std::byte> block) {
  const Cluster& b = facts.bounds;
  for (std::uint32_t i = 0; i < facts.count; ++i) {
    PackedGeometry g;
    std::memcpy(&g, &block[packed_offset(0, 16, i)], 16);
    std::memcpy(reinterpret_cast<std::byte*>(&g) + 16, &block[packed_offset(16, 16, i)], 16);
    for (int axis = 0; axis < 3; ++axis) {
      const double off = static_cast<double>(g.mean[axis]) - static_cast<double>(b.centre[axis]);
      if (!(std::abs(off) <= static_cast<double>(b.half_extent[axis]))) return "a mean";
    }
    if (!finite_half(g.base_red) || !finite_half(g.base_green) || !finite_half(g.base_blue))
      return "a base colour";
  }
  return nullptr;
}

/// The slots of a page that the tree has.
template <class Visit>
void for_each_slot(const TreeShape& shape, std::uint64_t number, const Visit& visit) {
  const NodeId root = shape.root_of(number);
  const int lowest = root.level / shape.page_levels() * shape.page_levels();
  for (int level = root.level; level >= lowest; --level) {
    const std::uint64_t width = std::uint64_t{1} << (root.level - level);
    const std::uint64_t first = root.index * width;
    const std::uint64_t end = std::min<std::uint64_t>(first + width, shape.nodes_on(level));
    for (std::uint64_t i = first; i < end; ++i)
      visit(NodeId{static_cast<std::uint8_t>(level), static_cast<std::uint32_t>(i)});
  }
}

}  // namespace

std::uint32_t TreePage::checksum(std::uint64_t number) const {
  constexpr std::size_t skipped = sizeof(std::uint32_t);
  const auto* bytes = reinterpret_cast<const Bytef*>(bytes_.data());
  const uLong start = crc32(0, reinterpret_cast<const Bytef*>(&number), sizeof number);
  return static_cast<std::uint32_t>(
      crc32(start, bytes + skipped, static_cast<uInt>(bytes_.size() - skipped)));
}

void TreePage::seal(std::uint64_t number) {
  const std::uint32_t sum = checksum(number);
  std::memcpy(bytes_.data(), &sum, sizeof sum);
}

void TreePage::check(std::uint64_t number, std::string_view file) const {
  const auto refuse = [&](const std::string& what) {
    throw InputError(file, fmt::format("page {} at byte {}", number, shape_->page_offset(number)),
                     what, "the file is damaged: convert the scene again");
  };
  std::uint32_t sum = 0;
  std::memcpy(&sum, bytes_.data(), sizeof sum);
  if (sum != checksum(number)) refuse("its checksum is wrong");
  for_each_slot(*shape_, number, [&](NodeId node) {
    const std::size_t slot = shape_->slot_of(node);
    const NodeFacts& f = facts(slot);
    const char* fault = fault_of(f);
    if (!fault) fault = fault_of(f, block(slot));
    const std::uint64_t first = std::uint64_t{node.index} * cluster_size;
    if (node.level == 0 && f.count != std::min(cluster_size, shape_->gaussians() - first))
      fault = "count";
    if (!fault && node.level == 0 && f.error != 0.0f) fault = "error of a leaf";
    if (!fault && slot > 0 && facts((slot - 1) / 2).error < f.error) fault = "error of a parent";
    if (fault)
      refuse(fmt::format("{} of node {}.{} is out of range", fault, node.level, node.index));
  });
}

}  // namespace catgs
