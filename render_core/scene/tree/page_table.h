#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "render_core/scene/tree/cut.h"

namespace catgs {

/// A page in a slot of a core's memory. The slot is free again when the last table that names the
/// page is gone, so a frame may read all pages of the table that it holds.
struct PageInSlot {
  std::uint64_t page = 0;
  std::uint32_t slot = 0;
  double shown_since_s = 0.0;     // in the pool's time
  std::vector<NodeFacts> facts;   // [TreeShape::slots()]
  std::shared_ptr<void> release;  // frees the slot
};

/// The pages of a tree that a core has in memory, at one moment. Constant once published. The pages
/// that refine one node come and go together, and a page is there only with the page above it.
class PageTable {
 public:
  explicit PageTable(const TreeShape& shape) : shape_(&shape) {}

  [[nodiscard]] const TreeShape& shape() const { return *shape_; }
  /// In no order.
  [[nodiscard]] const std::vector<std::shared_ptr<const PageInSlot>>& pages() const {
    return pages_;
  }
  [[nodiscard]] std::size_t size() const { return pages_.size(); }
  /// Null if it is not in memory.
  [[nodiscard]] const PageInSlot* find(std::uint64_t page) const {
    const auto found = by_number_.find(page);
    return found == by_number_.end() ? nullptr : found->second.page;
  }
  /// The page above a page: it holds the node that the page refines. Null for the root's.
  [[nodiscard]] const PageInSlot* above(std::uint64_t page) const {
    if (shape_->root_of(page) == shape_->root()) return nullptr;
    return find(shape_->page_of(refined_by(*shape_, page)));
  }
  /// The facts of the node that a page refines. Null for the root's page.
  [[nodiscard]] const NodeFacts* facts_above(std::uint64_t page) const {
    const PageInSlot* above = this->above(page);
    return above ? &above->facts[shape_->slot_of(refined_by(*shape_, page))] : nullptr;
  }
  /// When a page is shown that is shown no earlier than the page above.
  [[nodiscard]] double shown_since_above(std::uint64_t page) const {
    constexpr double long_ago_s = -1e9;
    const PageInSlot* above = this->above(page);
    return above == nullptr ? long_ago_s : above->shown_since_s;
  }
  /// A node's place in a core's arrays of clusters, where each slot has so many. Its page is in
  /// memory.
  [[nodiscard]] std::uint32_t cluster_of(NodeId node, std::size_t clusters_per_slot) const {
    return static_cast<std::uint32_t>(find(shape_->page_of(node))->slot * clusters_per_slot +
                                      shape_->slot_of(node));
  }

  /// Data that the core keeps with the table.
  std::shared_ptr<const void> of_core;

  void add(std::shared_ptr<const PageInSlot> page) {
    by_number_[page->page] = {page.get(), pages_.size()};
    pages_.push_back(std::move(page));
  }
  void remove(std::uint64_t page) {
    const auto found = by_number_.find(page);
    const std::size_t at = found->second.at;
    by_number_.erase(found);
    if (at + 1 < pages_.size()) {
      pages_[at] = std::move(pages_.back());
      by_number_[pages_[at]->page].at = at;
    }
    pages_.pop_back();
  }

  /// The nodes to draw: choose_cut() of what is in memory, `now_s` in the pool's time.
  [[nodiscard]] Cut cut(std::span<const Camera> cameras, float detail_px, double now_s,
                        const CutParts& parts = {}) const {
    const auto in_memory = [&](std::uint64_t number) -> PageInMemory {
      const PageInSlot* page = find(number);
      if (page == nullptr) return {};
      return {page->facts.data(), shown_share(now_s - page->shown_since_s), page->slot};
    };
    return choose_cut(*shape_, cameras, detail_px, in_memory, parts);
  }

 private:
  const TreeShape* shape_;
  std::vector<std::shared_ptr<const PageInSlot>> pages_;
  struct Entry {
    const PageInSlot* page;
    std::size_t at;  // in pages_
  };
  std::unordered_map<std::uint64_t, Entry> by_number_;
};

}  // namespace catgs
