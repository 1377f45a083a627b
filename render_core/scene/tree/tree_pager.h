#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <utility>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/math/camera.h"
#include "render_core/scene/tree/page_choice.h"
#include "render_core/scene/tree/page_table.h"
#include "render_core/scene/tree/tree_file.h"

namespace catgs {

/// The memory of a core for the pages of a tree: slots of one size.
class PageStore {
 public:
  virtual ~PageStore() = default;
  PageStore() = default;
  PageStore(const PageStore&) = delete;
  PageStore& operator=(const PageStore&) = delete;

  /// At least PageChoice::least_slots.
  [[nodiscard]] virtual std::uint32_t slots() const = 0;
  /// Writes page `number` to a slot that no frame reads. Called from several threads, with
  /// different slots.
  virtual void put(std::uint32_t slot, const TreePage& page, std::uint64_t number) = 0;
  /// Called before frames may see the table. When it returns, all of its pages can be read. May set
  /// PageTable::of_core.
  virtual void publish(PageTable& table) = 0;
};

/// The slots for a tree's pages in so much memory: all pages at most, and no fewer than
/// PageChoice::least_slots.
std::uint32_t slots_in(std::uint64_t memory_bytes, std::size_t cluster_bytes,
                       const TreeShape& shape);

/// The cameras and the detail of a View.
struct Lookout {
  std::vector<Camera> cameras;  // now, and where it may be soon
  float detail_px = 0.0f;

  bool operator==(const Lookout& other) const;
};

/// The link between a View and the pager. Its functions may be called from any thread.
class Watch {
 public:
  /// `wake`: called after each look() elsewhere.
  explicit Watch(std::function<void()> wake) : wake_(std::move(wake)) {}

  /// Says what the View draws now.
  void look(Lookout lookout);
  /// The lookout, and its number.
  struct Numbered {
    Lookout lookout;
    std::uint64_t number = 0;
  };
  [[nodiscard]] Numbered lookout() const;
  /// A turn of the pager has looked at the lookout with this number. `cut`: what was missing before
  /// the turn. `came`: whether pages came or went in it, so that there will be another.
  void turned(std::uint64_t number, const Cut& cut, bool came, double now_s);
  /// Whether the next frame for the same lookout may look better than one at `now_s`, in the
  /// pager's time: pages are still being read or blended in.
  [[nodiscard]] bool waits(double now_s) const;
  /// Number of pages that were missing of late: they are being read, or find no room.
  [[nodiscard]] std::uint32_t missing() const;
  /// The largest error that is drawn for want of them, px.
  [[nodiscard]] float coarsest_px() const;

 private:
  const std::function<void()> wake_;
  mutable std::mutex mutex_;  // guards the rest
  Lookout lookout_;
  std::uint64_t number_ = 0, turned_ = 0;  // of lookout_, and of the last one that was looked at
  bool more_comes_ = false;
  double blends_until_s_ = 0.0;
  std::uint32_t missing_ = 0;
  float coarsest_px_ = 0.0f;
};

/// Figures of a pager, of its whole life unless said.
struct PagerStats {
  std::uint32_t slots = 0;
  std::uint32_t in_memory = 0;  // pages now
  std::uint64_t loaded = 0;     // pages
  std::uint64_t loaded_bytes = 0;
  std::uint64_t unreadable = 0;  // pages
};

/// Keeps those pages of a tree in a core's memory that refine the nodes with the largest errors in
/// its Views' pictures. A thread of its own reads pages and makes room, so frames never wait. They
/// are drawn from what is there.
class TreePager {
 public:
  /// Reads the root's page, so that there is something to draw. Throws InputError if it cannot be
  /// read. `store` must outlive the pager.
  TreePager(std::shared_ptr<TreeFile> tree, PageStore& store);
  ~TreePager();

  [[nodiscard]] const TreeShape& shape() const { return tree_->shape(); }
  /// The pages in memory now. Throws what ended the pager: its core failed to take a page.
  [[nodiscard]] std::shared_ptr<const PageTable> table() const;
  /// The time of PageInSlot::shown_since_s.
  [[nodiscard]] double now_s() const;
  /// The pager must outlive the Watch's use.
  [[nodiscard]] std::shared_ptr<Watch> watch();
  /// Reads all that the lookout needs and memory has room for, and shows it at once.
  void settle(const Lookout& lookout);
  [[nodiscard]] PagerStats stats() const;

 private:
  class FreeSlots;
  enum class Arrival { blends, at_once };

  void run(const std::stop_token& stop);
  [[nodiscard]] std::vector<std::shared_ptr<Watch>> watches();
  bool turn(std::span<const std::shared_ptr<Watch>> watches, const Lookout* settled);
  bool carry_out(const PageChoice::Step& step, Arrival arrival);
  [[nodiscard]] std::vector<std::shared_ptr<PageInSlot>> read(
      std::span<const std::uint64_t> numbers);

  std::shared_ptr<TreeFile> tree_;
  PageStore& store_;
  std::shared_ptr<FreeSlots> free_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();

  std::mutex turn_mutex_;  // one turn at a time; guards choice_
  PageChoice choice_;

  mutable std::mutex mutex_;  // guards the next six
  std::condition_variable_any wake_;
  std::shared_ptr<const PageTable> table_;
  std::vector<std::weak_ptr<Watch>> watches_;
  PagerStats stats_;
  bool looked_ = false;         // since the last turn
  std::exception_ptr failure_;  // that ended the thread

  ThreadPool readers_;
  std::jthread thread_;
};

}  // namespace catgs
