#include "render_core/cuda/page_upload.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <unordered_map>

namespace catgs::cuda {
namespace {

constexpr double never_s = std::numeric_limits<double>::infinity();

/// The largest level of log2_opacity, which is below visibility.
constexpr std::uint16_t invisible = 65535;

/// Kernels draw all Gaussians of a block, so those that the node does not have become invisible.
void hide_rest(std::byte* block, std::size_t count) {
  for (std::size_t i = count; i < cluster_size; ++i)
    std::memcpy(block + packed_offset(0, 16, static_cast<std::uint32_t>(i)) +
                    offsetof(PackedGeometry, log2_opacity),
                &invisible, sizeof invisible);
}

/// Rows of nodes above the last one of the pages of a band.
int rows_above_bottom(const TreeShape& shape, int band) {
  return shape.top_level(band) - band * shape.page_levels();
}

}  // namespace

PageUpload::PageUpload(const TreeShape& shape, const TreePage& page, std::uint64_t number) {
  const auto whole =
      page.bytes().subspan(shape.block_offset(0), shape.slots() * shape.block_bytes());
  blocks.assign(whole.begin(), whole.end());
  errors.fill(-1.0f);
  for_each_node_in(shape, number, [&](NodeId node) {
    const std::size_t s = shape.slot_of(node);
    const NodeFacts& facts = page.facts(s);
    units[s] = facts.units;
    clusters[s] = facts.bounds;
    errors[s] = facts.error;
    hide_rest(blocks.data() + s * shape.block_bytes(), facts.count);
  });
}

std::vector<PageEntry> entries_of(const PageTable& table) {
  const TreeShape& shape = table.shape();
  std::vector<const PageInSlot*> pages;
  for (const auto& page : table.pages()) pages.push_back(page.get());
  std::ranges::sort(pages, {}, &PageInSlot::page);
  std::unordered_map<std::uint64_t, std::size_t> position_of;
  for (std::size_t i = 0; i < pages.size(); ++i) position_of[pages[i]->page] = i;
  std::vector<PageEntry> entries(pages.size());
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const PageInSlot& page = *pages[i];
    const int band = shape.band_of_page(page.page);
    entries[i] = {.shown_since_s = page.shown_since_s,
                  .below_since_s = {},
                  .slot = page.slot,
                  .above = PageEntry::no_node,
                  .first_bottom = (1u << rows_above_bottom(shape, band)) - 1u,
                  .top_level = static_cast<std::uint32_t>(shape.top_level(band))};
    std::ranges::fill(entries[i].below_since_s, never_s);
  }
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const PageInSlot* above = table.above(pages[i]->page);
    if (above == nullptr) continue;
    const auto refined =
        static_cast<std::uint32_t>(shape.slot_of(refined_by(shape, pages[i]->page)));
    entries[i].above = above->slot * clusters_per_slot + refined;
    PageEntry& entry_above = entries[position_of.at(above->page)];
    entry_above.below_since_s[refined - entry_above.first_bottom] = pages[i]->shown_since_s;
  }
  return entries;
}

}  // namespace catgs::cuda
