#include "render_core/scene/tree/page_pool.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "render_core/base/error.h"
#include "render_core/scene/tree/paged_tree.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto least_turn = 10ms;         // views draw up to 120 frames a second
constexpr std::uint32_t most_pages = 96;  // of a turn: about 30 MB
constexpr int most_readers = 8;
constexpr auto longest_frame = 5000ms;

int readers() { return std::clamp(processors() / 2, 1, most_readers); }

}  // namespace

PagePool::PagePool(std::uint32_t slots, std::uint64_t bytes, int settling_turns)
    : slots_(slots),
      bytes_(bytes),
      settling_turns_(settling_turns),
      free_(std::make_shared<FreeSlots>(slots)),
      choice_(slots),
      holders_(slots),
      readers_(readers()),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

PagePool::~PagePool() { assert(trees_.empty()); }

double PagePool::now_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

void PagePool::check() const {
  const std::lock_guard lock(failure_mutex_);
  if (failure_) std::rethrow_exception(failure_);
}

std::uint32_t PagePool::add(PagedTree& tree) {
  const std::lock_guard lock(turn_mutex_);
  check();
  const std::uint32_t number = next_number_++;
  const auto no_room = [&] {
    return InputError(tree.name(), "", "finds no room for its first page beside other trees",
                      "raise --scene-memory");
  };
  if (!choice_.add(number, tree.shape())) throw no_room();
  try {
    if (free_->count() == 0) turn_locked();  // others make room
    if (!free_->wait_for_one(longest_frame)) throw no_room();
    tree.open();
  } catch (...) {
    choice_.remove(number);
    std::ranges::replace(holders_, &tree, nullptr);
    free_->ring();  // the pages that made room for it may come back
    throw;
  }
  trees_[number] = &tree;
  return number;
}

void PagePool::remove(std::uint32_t number) {
  const std::lock_guard lock(turn_mutex_);
  const auto found = trees_.find(number);
  if (found == trees_.end()) return;
  std::ranges::replace(holders_, found->second, nullptr);
  trees_.erase(found);
  choice_.remove(number);
}

std::uint32_t PagePool::take_slot(PagedTree& tree) {
  const std::uint32_t slot = free_->take();
  PagedTree* const before = std::exchange(holders_[slot], &tree);
  if (before != nullptr && before != &tree) before->forget(slot);
  return slot;
}

void PagePool::run(const std::stop_token& stop) {
  bool goes_on = false;
  while (!stop.stop_requested()) {
    const auto began = std::chrono::steady_clock::now();
    if (!goes_on) free_->listen(stop);
    free_->hush();
    if (stop.stop_requested()) return;
    try {
      goes_on = turn();
    } catch (...) {  // a lost device, or no memory: the next frame says so
      return;
    }
    free_->pause(stop, began + least_turn);
  }
}

bool PagePool::turn() {
  const std::lock_guard lock(turn_mutex_);
  check();
  return turn_locked();
}

bool PagePool::turn_locked() {
  try {
    return look_and_change();
  } catch (...) {
    const std::lock_guard lock(failure_mutex_);
    failure_ = std::current_exception();
    throw;
  }
}

bool PagePool::look_and_change() {
  choice_.begin(now_s());
  for (const auto& [number, tree] : trees_)
    for (const PagedTree::Seen& seen : tree->look()) choice_.note(number, seen.cut);
  const std::uint32_t free = free_->count();
  const PageChoice::Step step = choice_.next(free, most_pages);
  free_->await(!step.awaited.empty(), free);
  std::map<std::uint32_t, PageChanges> changes;
  for (const PageOfTree& of : step.load) changes[of.tree].load.push_back(of.page);
  for (const PageOfTree& of : step.drop) changes[of.tree].drop.push_back(of.page);
  for (const PageOfTree& of : step.awaited) changes[of.tree].awaited.push_back(of.page);
  for (const auto& [number, tree] : trees_) {
    changes[number].more = step.cut_short;
    changes[number].budget_px = step.budget_px;
    for (const std::uint64_t page : tree->change(changes[number], readers_))
      choice_.failed({number, page});
  }
  return !step.load.empty() || !step.drop.empty();
}

}  // namespace catgs
