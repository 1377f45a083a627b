#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <unordered_set>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/tree/page_figures.h"
#include "render_core/scene/tree/page_pool.h"
#include "render_core/scene/tree/page_table.h"
#include "render_core/scene/tree/tree_file.h"
#include "render_core/scene/tree/watch.h"

namespace catgs {

/// The memory of a core for the pages of one tree, by the slots of a pool.
class PageStore {
 public:
  virtual ~PageStore() = default;
  PageStore() = default;
  PageStore(const PageStore&) = delete;
  PageStore& operator=(const PageStore&) = delete;

  /// Writes page `number` to a slot that no frame reads. Called from several threads, with
  /// different slots.
  virtual void put(std::uint32_t slot, const TreePage& page, std::uint64_t number) = 0;
  /// Called before frames may see the table. When it returns, all of its pages can be read. May set
  /// PageTable::of_core.
  virtual void publish(PageTable& table) = 0;
  /// The slot has no page of this tree any more, and no frame reads it.
  virtual void release(std::uint32_t slot) = 0;
};

/// The slots for a tree that has a pool of its own, in so much memory: all pages at most, and no
/// fewer than PageChoice::least_slots.
std::uint32_t slots_in(std::uint64_t memory_bytes, std::size_t slot_bytes, const TreeShape& shape);

/// A part of a PageChoice::Step: that of one tree.
struct PageChanges {
  std::vector<std::uint64_t> load, drop, awaited;
  bool more = false;  // the step was cut short
  float budget_px = 0.0f;
};

/// A tree and those of its pages that a pool holds.
class PagedTree {
 public:
  /// Reads the root's page, so that there is something to draw. Throws InputError if it cannot be
  /// read, or if the pool is full. `store` must outlive the tree and its tables.
  PagedTree(std::shared_ptr<PagePool> pool, std::shared_ptr<TreeFile> file, PageStore& store);
  ~PagedTree();
  PagedTree(const PagedTree&) = delete;
  PagedTree& operator=(const PagedTree&) = delete;

  [[nodiscard]] const TreeShape& shape() const { return file_->shape(); }
  [[nodiscard]] const std::string& name() const { return file_->name(); }
  /// The pages in memory now. Throws what ended the pool.
  [[nodiscard]] std::shared_ptr<const PageTable> table() const;
  /// The time of PageInSlot::shown_since_s.
  [[nodiscard]] double now_s() const { return pool_->now_s(); }
  [[nodiscard]] std::shared_ptr<Watch> watch();
  /// Reads all that this View's demand needs and memory has room for, beside the other Views: in
  /// PagePool::settling_turns() turns, or as much as they bring.
  void settle(const Watch& watch);
  [[nodiscard]] PageFigures figures() const;

  // The rest is for the pool, in its turns.

  /// Reads the root's page.
  void open();
  struct Seen {
    std::shared_ptr<Watch> watch;
    std::uint64_t number;  // of its demand
    bool at_once;
    Cut cut;  // its pages alone; those that are only being blended in count as shown
  };
  /// The cuts of all Views.
  [[nodiscard]] std::span<const Seen> look();
  /// Loads and drops pages, and tells the Views that look() has seen. Returns the pages that cannot
  /// be read; their families are not loaded.
  std::vector<std::uint64_t> change(const PageChanges& changes, ThreadPool& readers);

 private:
  using Page = std::shared_ptr<PageInSlot>;

  [[nodiscard]] std::vector<Page> read(std::span<const std::uint64_t> numbers, ThreadPool& readers);
  [[nodiscard]] Page read(std::uint64_t number, std::uint32_t slot);
  void publish(std::span<const Page> loaded, std::span<const std::uint64_t> dropped);
  [[nodiscard]] std::vector<std::shared_ptr<Watch>> watches() const;

  const std::shared_ptr<PagePool> pool_;
  const std::shared_ptr<TreeFile> file_;
  PageStore& store_;
  std::vector<Seen> seen_;                    // in this turn
  std::unordered_set<std::uint64_t> broken_;  // families with a page that cannot be read

  mutable std::mutex mutex_;  // guards the next three
  std::shared_ptr<const PageTable> table_;
  mutable std::vector<std::weak_ptr<Watch>> watches_;
  std::uint64_t loaded_ = 0;  // pages

  const std::uint32_t number_;  // in the pool; the last member, because it ends the construction
};

}  // namespace catgs
