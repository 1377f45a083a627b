#include "render_core/scene/tree/tree_pager.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "render_core/base/error.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto least_turn = 10ms;         // views draw up to 120 frames a second
constexpr std::uint32_t most_pages = 96;  // of a turn: about 30 MB
constexpr int most_readers = 8;
constexpr int most_settling_turns = 10'000;

bool same(const Camera& a, const Camera& b) {
  const Pose &at = a.world_from_camera, &bt = b.world_from_camera;
  return at.position == bt.position && at.orientation == bt.orientation && a.size_px == b.size_px &&
         a.focal_px == b.focal_px && a.principal_point_px == b.principal_point_px &&
         a.near_z == b.near_z;
}

int readers() { return std::clamp(processors() / 2, 1, most_readers); }

}  // namespace

/// The slots that no page has. Tables give slots back when they go, on any thread.
class TreePager::FreeSlots {
 public:
  explicit FreeSlots(std::uint32_t slots) {
    for (std::uint32_t slot = slots; slot-- > 0;) free_.push_back(slot);
  }
  [[nodiscard]] std::uint32_t count() const {
    const std::lock_guard lock(mutex_);
    return static_cast<std::uint32_t>(free_.size());
  }
  std::uint32_t take() {
    const std::lock_guard lock(mutex_);
    const std::uint32_t slot = free_.back();
    free_.pop_back();
    return slot;
  }
  void give_back(std::uint32_t slot) {
    const std::lock_guard lock(mutex_);
    free_.push_back(slot);
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::uint32_t> free_;
};

std::uint32_t slots_in(std::uint64_t memory_bytes, std::size_t cluster_bytes,
                       const TreeShape& shape) {
  const std::uint64_t fit = memory_bytes / (cluster_bytes * shape.slots());
  return static_cast<std::uint32_t>(
      std::max<std::uint64_t>(PageChoice::least_slots, std::min(fit, shape.pages())));
}

bool Lookout::operator==(const Lookout& other) const {
  return detail_px == other.detail_px && std::ranges::equal(cameras, other.cameras, same);
}

void Watch::look(Lookout lookout) {
  {
    const std::lock_guard lock(mutex_);
    if (lookout == lookout_) return;
    lookout_ = std::move(lookout);
    ++number_;
  }
  wake_();
}

Watch::Numbered Watch::lookout() const {
  const std::lock_guard lock(mutex_);
  return {lookout_, number_};
}

void Watch::turned(std::uint64_t number, const Cut& cut, bool came, double now_s) {
  const std::lock_guard lock(mutex_);
  turned_ = number;
  missing_ = static_cast<std::uint32_t>(cut.missing.size());
  coarsest_px_ = cut.missing.empty() ? 0.0f : cut.missing.front().error_px;
  more_comes_ = came && !cut.missing.empty();
  if (more_comes_) blends_until_s_ = now_s + all_shown_s;
}

bool Watch::waits(double now_s) const {
  const std::lock_guard lock(mutex_);
  return turned_ != number_ || more_comes_ || now_s < blends_until_s_;
}

std::uint32_t Watch::missing() const {
  const std::lock_guard lock(mutex_);
  return missing_;
}

float Watch::coarsest_px() const {
  const std::lock_guard lock(mutex_);
  return coarsest_px_;
}

TreePager::TreePager(std::shared_ptr<TreeFile> tree, PageStore& store)
    : tree_(std::move(tree)),
      store_(store),
      free_(std::make_shared<FreeSlots>(store.slots())),
      choice_(tree_->shape(), store.slots()),
      table_(std::make_shared<PageTable>(tree_->shape(), store.slots())),
      readers_(readers()) {
  stats_.slots = store.slots();
  const std::uint64_t root[] = {tree_->shape().page_of(tree_->shape().root())};
  if (!carry_out({.load = {root[0]}, .drop = {}}, Arrival::at_once))
    throw InputError("", "", tree_->damage().first, "convert the scene again");
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

TreePager::~TreePager() = default;

std::shared_ptr<const PageTable> TreePager::table() const {
  const std::lock_guard lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);
  return table_;
}

double TreePager::now_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

std::shared_ptr<Watch> TreePager::watch() {
  auto watch = std::make_shared<Watch>([this] {
    {
      const std::lock_guard lock(mutex_);
      looked_ = true;
    }
    wake_.notify_one();
  });
  const std::lock_guard lock(mutex_);
  watches_.push_back(watch);
  return watch;
}

PagerStats TreePager::stats() const {
  const std::lock_guard lock(mutex_);
  return stats_;
}

void TreePager::run(const std::stop_token& stop) {
  bool goes_on = false;
  while (!stop.stop_requested()) {
    const auto began = std::chrono::steady_clock::now();
    {
      std::unique_lock lock(mutex_);
      if (!goes_on) wake_.wait(lock, stop, [this] { return looked_; });
      looked_ = false;
    }
    if (stop.stop_requested()) return;
    try {
      goes_on = turn(watches(), nullptr);
    } catch (...) {  // a lost device, or no memory: the next frame says so
      const std::lock_guard lock(mutex_);
      failure_ = std::current_exception();
      return;
    }
    std::unique_lock lock(mutex_);
    wake_.wait_until(lock, stop, began + least_turn, [] { return false; });
  }
}

/// The Views that are still there.
std::vector<std::shared_ptr<Watch>> TreePager::watches() {
  std::vector<std::shared_ptr<Watch>> alive;
  const std::lock_guard lock(mutex_);
  std::erase_if(watches_, [&](const std::weak_ptr<Watch>& weak) {
    if (auto watch = weak.lock()) {
      alive.push_back(std::move(watch));
      return false;
    }
    return true;
  });
  return alive;
}

void TreePager::settle(const Lookout& lookout) {
  for (int i = 0; i < most_settling_turns && turn({}, &lookout); ++i) {
  }
}

/// Looks at the cuts of all, and then loads and drops pages. Returns whether any came or went.
bool TreePager::turn(std::span<const std::shared_ptr<Watch>> watches, const Lookout* settled) {
  const std::lock_guard lock(turn_mutex_);
  const std::shared_ptr<const PageTable> table = this->table();
  // Pages that are only being blended in count as shown.
  constexpr double later = std::numeric_limits<double>::infinity();
  struct Looked {
    Watch* watch;
    std::uint64_t number;
    Cut cut;
  };
  std::vector<Looked> looked;
  choice_.begin(now_s());
  for (const std::shared_ptr<Watch>& watch : watches) {
    const auto [lookout, number] = watch->lookout();
    if (lookout.cameras.empty()) continue;
    looked.push_back({watch.get(), number, table->cut(lookout.cameras, lookout.detail_px, later)});
    choice_.note(looked.back().cut);
  }
  if (settled != nullptr) choice_.note(table->cut(settled->cameras, settled->detail_px, later));
  const std::uint32_t free = free_->count();
  const auto in_memory = static_cast<std::uint32_t>(table->size());
  const PageChoice::Step step = choice_.next(free, store_.slots() - free - in_memory, most_pages);
  const bool came = carry_out(step, settled != nullptr ? Arrival::at_once : Arrival::blends);
  for (const Looked& l : looked) l.watch->turned(l.number, l.cut, came, now_s());
  return came;
}

/// Returns whether pages came or went.
bool TreePager::carry_out(const PageChoice::Step& step, Arrival arrival) {
  if (step.load.empty() && step.drop.empty()) return false;
  const std::vector<std::shared_ptr<PageInSlot>> loaded = read(step.load);
  auto next = std::make_shared<PageTable>(*this->table());
  next->of_core.reset();
  for (const std::uint64_t page : step.drop) next->remove(page);
  const double now = now_s();
  std::uint32_t count = 0;
  for (const std::shared_ptr<PageInSlot>& page : loaded) {
    if (!page) continue;
    page->shown_since_s = arrival == Arrival::blends ? now : next->shown_since_above(page->page);
    next->add(page);
    ++count;
  }
  store_.publish(*next);
  const std::lock_guard lock(mutex_);
  table_ = std::move(next);
  stats_.in_memory = static_cast<std::uint32_t>(table_->size());
  stats_.loaded += count;
  stats_.loaded_bytes += count * tree_->shape().page_bytes();
  stats_.unreadable = tree_->damage().pages;
  return count > 0 || !step.drop.empty();
}

/// Reads pages into free slots. Null stands for each page of a family with a page that cannot be
/// read.
std::vector<std::shared_ptr<PageInSlot>> TreePager::read(std::span<const std::uint64_t> numbers) {
  std::vector<std::shared_ptr<PageInSlot>> pages(numbers.size());
  std::vector<std::uint32_t> slots;
  for (std::size_t i = 0; i < numbers.size(); ++i) slots.push_back(free_->take());
  readers_.parallel_for(numbers.size(), [&](std::size_t i) {
    const std::uint32_t slot = slots[i];
    const std::shared_ptr<void> release(nullptr,
                                        [free = free_, slot](void*) { free->give_back(slot); });
    const std::shared_ptr<const TreePage> bytes = tree_->page(numbers[i]);
    if (!bytes) return;
    store_.put(slot, *bytes, numbers[i]);
    auto page = std::make_shared<PageInSlot>();
    page->page = numbers[i];
    page->slot = slot;
    page->release = release;
    for (std::size_t s = 0; s < tree_->shape().slots(); ++s) page->facts.push_back(bytes->facts(s));
    pages[i] = std::move(page);
  });
  for (std::size_t i = 0; i < pages.size(); ++i) {
    if (pages[i]) continue;
    choice_.failed(numbers[i]);
    for (std::size_t j = 0; j < pages.size(); ++j)
      if (pages[j] && choice_.family_of(numbers[i]) == choice_.family_of(numbers[j]))
        pages[j].reset();
  }
  return pages;
}

}  // namespace catgs
