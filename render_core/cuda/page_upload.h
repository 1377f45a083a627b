#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "render_core/cuda/tree_cut.h"
#include "render_core/scene/tree/page_table.h"
#include "render_core/scene/tree/tree_page.h"

namespace catgs::cuda {

// What the device gets of a tree, made on the host: without CUDA, so that every build tests it.

/// A page as its slot holds it.
struct PageUpload {
  PageUpload(const TreeShape& shape, const TreePage& page, std::uint64_t number);

  std::vector<std::byte> blocks;  // of all slots of the page
  std::array<PackedUnits, clusters_per_slot> units{};
  std::array<Cluster, clusters_per_slot> clusters{};
  std::array<float, clusters_per_slot> errors;  // negative: there is no such node
};

/// A table's pages in the order of their numbers, so that the order of equal depths does not depend
/// on slots.
std::vector<PageEntry> entries_of(const PageTable& table);

}  // namespace catgs::cuda
