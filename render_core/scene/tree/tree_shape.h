#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstddef>
#include <cstdint>

#include "render_core/scene/clusters.h"
#include "render_core/scene/packed_gaussian.h"

namespace catgs {

/// A node of a tree of clusters. Level 0 holds the leaves; node i of a level stands for the nodes
/// 2 i and 2 i + 1 of the level below, or for the first of them where that level ends.
struct NodeId {
  std::uint8_t level = 0;
  std::uint32_t index = 0;

  bool operator==(const NodeId&) const = default;
};

/// The facts of a node that a page holds beside its records.
struct alignas(16) NodeFacts {
  PackedUnits units;
  Cluster bounds;             // of the node's Gaussians and of all that it stands for
  float error;                // world units; 0 for leaves, see merge_nodes.h
  std::uint32_t count;        // Gaussians, 1 to cluster_size
  std::uint32_t reserved[3];  // zeros
};
static_assert(sizeof(NodeFacts) == 64);

/// How N Gaussians become leaves, levels, pages and bytes of a file. All of it follows from N and
/// the SH degree, so a tree has no pointers and its file no directory.
///
/// A page holds a subtree of up to page_levels() levels, root first, as a heap: the children of
/// slot s are the slots 2 s + 1 and 2 s + 2. Pages come in bands of that many levels, counted from
/// the leaves. The band of the root comes first in the file, so a file that is cut off has lost
/// detail and no region.
class TreeShape {
 public:
  static constexpr std::uint64_t max_gaussians = std::uint64_t{1} << 34;
  static constexpr std::size_t header_bytes = 4096;
  static constexpr std::size_t page_head_bytes = 64;
  static constexpr std::size_t page_alignment = 4096;

  /// `gaussians`: 1 to max_gaussians.
  TreeShape(std::uint64_t gaussians, int sh_degree) : gaussians_(gaussians), degree_(sh_degree) {
    assert(gaussians > 0 && gaussians <= max_gaussians);
    leaves_ = static_cast<std::uint32_t>((gaussians + cluster_size - 1) / cluster_size);
    root_level_ = std::bit_width(leaves_ - 1);
    bands_ = root_level_ / page_levels() + 1;
    std::uint64_t page = 0;
    for (int band = bands_ - 1; band >= 0; --band) {
      first_page_[static_cast<std::size_t>(band)] = page;
      page += pages_of(band);
    }
    pages_ = page;
  }

  [[nodiscard]] std::uint64_t gaussians() const { return gaussians_; }
  [[nodiscard]] int sh_degree() const { return degree_; }
  [[nodiscard]] std::uint32_t leaves() const { return leaves_; }
  [[nodiscard]] int levels() const { return root_level_ + 1; }
  [[nodiscard]] NodeId root() const { return {static_cast<std::uint8_t>(root_level_), 0}; }
  [[nodiscard]] std::uint32_t nodes_on(int level) const {
    return static_cast<std::uint32_t>((std::uint64_t{leaves_} + (std::uint64_t{1} << level) - 1) >>
                                      level);
  }

  // --- Pages ---
  /// The most levels whose blocks fill at most 320 KiB: 5 for SH degrees 0 and 1, else 4.
  [[nodiscard]] int page_levels() const { return degree_ < 2 ? 5 : 4; }
  [[nodiscard]] int bands() const { return bands_; }
  [[nodiscard]] std::uint64_t pages() const { return pages_; }
  [[nodiscard]] std::uint64_t pages_of(int band) const { return nodes_on(top_level(band)); }
  [[nodiscard]] std::uint64_t page(int band, std::uint32_t index) const {
    return first_page_[static_cast<std::size_t>(band)] + index;
  }
  /// Level of the roots of a band's pages.
  [[nodiscard]] int top_level(int band) const {
    return std::min((band + 1) * page_levels() - 1, root_level_);
  }
  [[nodiscard]] int band_of_page(std::uint64_t page) const {
    int band = bands_ - 1;
    while (band > 0 && page >= first_page_[static_cast<std::size_t>(band - 1)]) --band;
    return band;
  }
  /// The node at the root of a page.
  [[nodiscard]] NodeId root_of(std::uint64_t page) const {
    const int band = band_of_page(page);
    return {static_cast<std::uint8_t>(top_level(band)),
            static_cast<std::uint32_t>(page - first_page_[static_cast<std::size_t>(band)])};
  }

  // --- Nodes in pages ---
  [[nodiscard]] std::uint64_t page_of(NodeId node) const {
    const int band = node.level / page_levels();
    return page(band, node.index >> (top_level(band) - node.level));
  }
  [[nodiscard]] std::size_t slot_of(NodeId node) const {
    const int depth = top_level(node.level / page_levels()) - node.level;
    const std::size_t row = std::size_t{1} << depth;
    return row - 1 + (node.index & (row - 1));
  }
  [[nodiscard]] std::size_t slots() const { return (std::size_t{1} << page_levels()) - 1; }

  // --- Bytes ---
  [[nodiscard]] std::size_t block_bytes() const { return packed_block_bytes(degree_); }
  [[nodiscard]] std::size_t facts_offset(std::size_t slot) const {
    return page_head_bytes + slot * sizeof(NodeFacts);
  }
  [[nodiscard]] std::size_t block_offset(std::size_t slot) const {
    return facts_offset(slots()) + slot * block_bytes();
  }
  [[nodiscard]] std::size_t page_bytes() const {
    return (block_offset(slots()) + page_alignment - 1) / page_alignment * page_alignment;
  }
  [[nodiscard]] std::uint64_t page_offset(std::uint64_t page) const {
    return header_bytes + page * page_bytes();
  }
  [[nodiscard]] std::uint64_t file_bytes() const { return page_offset(pages_); }

 private:
  std::uint64_t gaussians_;
  int degree_;
  std::uint32_t leaves_;
  int root_level_, bands_;
  std::array<std::uint64_t, 8> first_page_{};  // by band
  std::uint64_t pages_;
};

/// The node that a page refines. The page is not that of the root.
inline NodeId refined_by(const TreeShape& shape, std::uint64_t page) {
  const NodeId root = shape.root_of(page);
  return {static_cast<std::uint8_t>(root.level + 1), root.index / 2};
}

/// Pages come and go by family: the one or two pages that refine one node. The first of them.
inline std::uint64_t family_of(const TreeShape& shape, std::uint64_t page) {
  return shape.root_of(page).index % 2 == 1 ? page - 1 : page;
}

/// The pages of the family that begins with `first`.
inline std::uint32_t family_size(const TreeShape& shape, std::uint64_t first) {
  const NodeId root = shape.root_of(first);
  return root.index + 1 < shape.nodes_on(root.level) ? 2 : 1;
}

/// Calls visit(node) for each node of a page, the root first. The page's other slots are unused.
template <class Visit>
void for_each_node_in(const TreeShape& shape, std::uint64_t page, const Visit& visit) {
  const NodeId root = shape.root_of(page);
  const int lowest = root.level / shape.page_levels() * shape.page_levels();
  for (int level = root.level; level >= lowest; --level) {
    const std::uint64_t width = std::uint64_t{1} << (root.level - level);
    const std::uint64_t first = root.index * width;
    const std::uint64_t end = std::min<std::uint64_t>(first + width, shape.nodes_on(level));
    for (std::uint64_t i = first; i < end; ++i)
      visit(NodeId{static_cast<std::uint8_t>(level), static_cast<std::uint32_t>(i)});
  }
}

}  // namespace catgs
