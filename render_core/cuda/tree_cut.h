#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "render_core/base/host_device.h"
#include "render_core/scene/clusters.h"
#include "render_core/scene/tree/cut.h"

namespace catgs::cuda {

/// Each slot of a pool has so many clusters, whatever the tree. No page has more nodes.
constexpr std::uint32_t slot_shift = 5;
constexpr std::uint32_t clusters_per_slot = 1u << slot_shift;

/// A page in a slot, as kernels see it.
struct PageEntry {
  static constexpr std::uint32_t no_node = ~std::uint32_t{0};
  static constexpr int most_bottom_nodes = 16;

  double shown_since_s;
  // For each node of the page's last row: shown_since_s of the pages with its children; infinite
  // where they are not in memory, or where there are none.
  double below_since_s[most_bottom_nodes];
  std::uint32_t slot;
  std::uint32_t above;  // cluster of the node that the page refines; no_node: the root's page
  std::uint32_t first_bottom;  // first node of the last row
  std::uint32_t top_level;     // of its first node
};

/// The pages of a tree that are in memory. The nodes of a frame are numbered through: node n is
/// number n % clusters_per_slot of page n / clusters_per_slot. The first nodes of a page exist.
struct TreeArrays {
  const PageEntry* pages = nullptr;  // [page_count]
  std::uint32_t page_count = 0;
  const float* errors = nullptr;  // [cluster], world units; negative: there is no such node

  [[nodiscard]] CATGS_HD std::uint32_t nodes() const { return page_count * clusters_per_slot; }
  [[nodiscard]] CATGS_HD std::uint32_t cluster_of(std::uint32_t n) const {
    return pages[n / clusters_per_slot].slot * clusters_per_slot + n % clusters_per_slot;
  }
};

/// A cut of a tree: choose_cut() for each node by itself.
struct TreeCut {
  TreeArrays tree;
  CutEye now, end;  // at the end of the frame's window; the same if it has none
  float detail_px;
  double now_s;
  float* share;  // [cluster], the part of each node that is drawn

  [[nodiscard]] CATGS_HD std::uint32_t level_of(std::uint32_t n) const {
    const std::uint32_t rank = n % clusters_per_slot + 1;
#if defined(__CUDA_ARCH__)
    const int depth = 31 - __clz(static_cast<int>(rank));
#else
    const int depth = static_cast<int>(std::bit_width(rank)) - 1;
#endif
    return tree.pages[n / clusters_per_slot].top_level - static_cast<std::uint32_t>(depth);
  }

  /// The part of the node of cluster `c` that its descendants have taken over where they are all
  /// shown.
  [[nodiscard]] CATGS_HD float split(const Cluster* clusters, std::uint32_t c) const {
    const float error = tree.errors[c];
    return split_share(fmaxf(now.error_px(error, clusters[c]), end.error_px(error, clusters[c])),
                       detail_px);
  }

  /// The part of node `n` that is drawn. Both cuts of a node and of its children follow from errors
  /// that grow towards the root, and from pages that come no earlier than the page above. So no
  /// other node needs to be asked.
  [[nodiscard]] CATGS_HD float share_of(const Cluster* clusters, std::uint32_t n) const {
    const std::uint32_t in_page = n % clusters_per_slot;
    const PageEntry& page = tree.pages[n / clusters_per_slot];
    const std::uint32_t c = tree.cluster_of(n);
    const float shown = shown_share(now_s - page.shown_since_s);
    if (shown <= 0.0f || tree.errors[c] < 0.0f) return 0.0f;
    const std::uint32_t above = in_page == 0 ? page.above : c - in_page + (in_page - 1) / 2;
    const float taken = above == PageEntry::no_node ? 1.0f : fminf(shown, split(clusters, above));
    const float shown_below =
        in_page < page.first_bottom
            ? shown
            : shown_share(now_s - page.below_since_s[in_page - page.first_bottom]);
    const float given = shown_below > 0.0f ? fminf(shown_below, split(clusters, c)) : 0.0f;
    return fmaxf(0.0f, taken - given);
  }
};

}  // namespace catgs::cuda
