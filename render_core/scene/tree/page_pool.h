#pragma once

#include <chrono>
#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/tree/free_slots.h"
#include "render_core/scene/tree/page_choice.h"

namespace catgs {

class PagedTree;

/// The memory of a device for pages, shared by all trees there. It keeps those pages that refine
/// the nodes with the largest errors in the pictures of all Views. A thread of its own reads pages
/// and makes room, so frames never wait. They are drawn from what is there.
class PagePool {
 public:
  /// More than any scene needs.
  static constexpr int all_turns = 10'000;
  /// `slots`: at least PageChoice::least_slots. `bytes`: the memory of all slots, for reports.
  /// `settling_turns`: for which a frame may wait until its pages are there.
  PagePool(std::uint32_t slots, std::uint64_t bytes, int settling_turns = all_turns);
  /// No tree may be left.
  virtual ~PagePool();
  PagePool(const PagePool&) = delete;
  PagePool& operator=(const PagePool&) = delete;

  [[nodiscard]] std::uint32_t slots() const { return slots_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  [[nodiscard]] int settling_turns() const { return settling_turns_; }
  [[nodiscard]] const std::shared_ptr<FreeSlots>& free() const { return free_; }
  /// The time of PageInSlot::shown_since_s.
  [[nodiscard]] double now_s() const;
  /// Throws what ended the pool: its core failed to take a page.
  void check() const;

  /// Adds a tree and reads its root's page. Returns its number here. Throws InputError if the page
  /// cannot be read, or if the pool has no room for it.
  std::uint32_t add(PagedTree& tree);
  void remove(std::uint32_t number);
  /// Looks at the cuts of all Views, and then loads and drops pages. Returns whether any came or
  /// went. The pool's thread does so by itself.
  bool turn();
  /// Takes a free slot for a page of `tree`, in its turn. Another tree's memory there is given
  /// back.
  [[nodiscard]] std::uint32_t take_slot(PagedTree& tree);

 private:
  void run(const std::stop_token& stop);
  /// An exception ends the pool.
  bool turn_locked();
  bool look_and_change();

  const std::uint32_t slots_;
  const std::uint64_t bytes_;
  const int settling_turns_;
  const std::shared_ptr<FreeSlots> free_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();

  std::mutex turn_mutex_;  // one turn at a time; guards the next four
  PageChoice choice_;
  std::map<std::uint32_t, PagedTree*> trees_;
  std::uint32_t next_number_ = 0;
  std::vector<PagedTree*> holders_;  // [slot]: the tree that has memory there

  mutable std::mutex failure_mutex_;
  std::exception_ptr failure_;  // that ended the pool

  ThreadPool readers_;
  std::jthread thread_;
};

}  // namespace catgs
