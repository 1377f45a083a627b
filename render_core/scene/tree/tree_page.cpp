#include "render_core/scene/tree/tree_page.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include <fmt/format.h>
#include <zlib.h>

#include "render_core/base/error.h"
#include "render_core/math/camera.h"

namespace catgs {
namespace {

// sanitize() allows harmonics up to 1000.
constexpr float largest_sh_unit = 1e3f / 127.0f * 0x1p15f;
constexpr std::uint16_t largest_base = 0x63d0;  // 1000 as a half

// Scales and coordinates are up to max_coordinate. Merged Gaussians span the box of their means,
// so no entry of a factor reaches 2^32. A unit is 2^-14 of the largest entry.
constexpr int largest_unit_exponent = 20;
constexpr int least_unit_exponent = -126 + 63;  // 63 octaves below, entries are normal floats
constexpr float largest_reach = 64.0f * max_coordinate;

bool in_range_half(std::uint16_t bits) { return (bits & 0x7fffu) <= largest_base; }

/// `bytes`: at least one.
bool zeros(std::span<const std::byte> bytes) {
  return bytes.front() == std::byte{0} &&
         std::memcmp(bytes.data(), bytes.data() + 1, bytes.size() - 1) == 0;
}

/// Names the first fact of a node that is out of range; null if none is.
const char* fault_of(const NodeFacts& facts) {
  const Cluster& b = facts.bounds;
  if (facts.count < 1 || facts.count > cluster_size) return "count";
  if (!(facts.error >= 0.0f && facts.error <= max_coordinate)) return "error";
  if (!(b.reach >= 0.0f && b.reach <= largest_reach)) return "reach";
  for (int axis = 0; axis < 3; ++axis)
    if (!(std::abs(b.centre[axis]) <= max_coordinate && b.half_extent[axis] >= 0.0f &&
          b.half_extent[axis] <= 2.1f * max_coordinate))
      return "bounds";
  if (std::ranges::count(facts.reserved, 0u) != 3) return "reserved word";
  int exponent = 0;  // of a power of two, plus 1
  if (!std::isfinite(facts.units.factor) || std::frexp(facts.units.factor, &exponent) != 0.5f ||
      exponent - 1 < least_unit_exponent || exponent - 1 > largest_unit_exponent)
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
    if (!in_range_half(g.base_red) || !in_range_half(g.base_green) || !in_range_half(g.base_blue))
      return "a base colour";
  }
  return nullptr;
}

/// Whether all records of a block from number `count` on are zeros.
bool ends_at(std::span<const std::byte> block, std::uint32_t count, int sh_degree) {
  if (count == cluster_size) return true;
  for (int at = 0; at < packed_record_bytes(sh_degree);) {
    const int width = packed_plane_width(sh_degree, at);
    const std::uint32_t begin = packed_offset(at, width, count);
    if (!zeros(block.subspan(begin, packed_offset(at, width, cluster_size) - begin))) return false;
    at += width;
  }
  return true;
}

/// Names the first fact in which a node exceeds the node above it; null if none does.
const char* excess_over(const NodeFacts& above, const NodeFacts& node) {
  constexpr double rounding = 1e-12, least = std::numeric_limits<float>::min();
  if (node.error > above.error) return "error";
  if (node.bounds.reach > above.bounds.reach) return "reach";
  for (int axis = 0; axis < 3; ++axis) {
    const auto of = [axis](const glm::vec3& v) { return static_cast<double>(v[axis]); };
    const double centre = of(above.bounds.centre);
    const double reaches = std::abs(of(node.bounds.centre) - centre) + of(node.bounds.half_extent);
    if (reaches > of(above.bounds.half_extent) + rounding * std::abs(centre) + least) return "box";
  }
  return nullptr;
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

void TreePage::check(std::uint64_t number, std::string_view file, const NodeFacts* above) const {
  const auto refuse = [&](const std::string& what) {
    throw InputError(file, fmt::format("page {} at byte {}", number, shape_->page_offset(number)),
                     what, "the file is damaged: convert the scene again");
  };
  std::uint32_t sum = 0;
  std::memcpy(&sum, bytes_.data(), sizeof sum);
  if (sum != checksum(number)) refuse("its checksum is wrong");
  std::uint32_t used = 0;  // a bit for each slot
  for_each_node_in(*shape_, number, [&](NodeId node) {
    const std::size_t slot = shape_->slot_of(node);
    used |= 1u << slot;
    const NodeFacts& f = facts(slot);
    const char* fault = fault_of(f);
    if (!fault) fault = fault_of(f, block(slot));
    const std::uint64_t first = std::uint64_t{node.index} * cluster_size;
    if (node.level == 0 && f.count != std::min(cluster_size, shape_->gaussians() - first))
      fault = "count";
    if (!fault && node.level == 0 && f.error != 0.0f) fault = "error of a leaf";
    if (fault)
      refuse(fmt::format("{} of node {}.{} is out of range", fault, node.level, node.index));
    if (!ends_at(block(slot), f.count, shape_->sh_degree()))
      refuse(fmt::format("unused records of node {}.{} are not zeros", node.level, node.index));
    const NodeFacts* parent = slot > 0 ? &facts((slot - 1) / 2) : above;
    if (const char* excess = parent ? excess_over(*parent, f) : nullptr)
      refuse(fmt::format("{} of node {}.{} exceeds that of the node above", excess, node.level,
                         node.index));
  });
  const std::string unused = unused_fault(used);
  if (!unused.empty()) refuse(unused + " are not zeros");
}

void TreePage::clear_sh_octaves() {
  if (shape_->sh_degree() == 0) return;
  for (std::size_t slot = 0; slot < shape_->slots(); ++slot)
    catgs::clear_sh_octaves(block(slot), facts(slot).count);
}

std::string TreePage::unused_fault(std::uint32_t used) const {
  const auto all = bytes();
  if (!zeros(all.first(TreeShape::page_head_bytes).subspan(sizeof(std::uint32_t))))
    return "bytes 4 to 63";
  for (std::size_t slot = 0; slot < shape_->slots(); ++slot) {
    if ((used >> slot & 1u) != 0) continue;
    if (!zeros(all.subspan(shape_->facts_offset(slot), sizeof(NodeFacts))))
      return fmt::format("facts of unused slot {}", slot);
    if (!zeros(block(slot))) return fmt::format("records of unused slot {}", slot);
  }
  const auto end = all.subspan(shape_->block_offset(shape_->slots()));
  return end.empty() || zeros(end) ? "" : "bytes behind the last block";
}

}  // namespace catgs
