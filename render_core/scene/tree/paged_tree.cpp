#include "render_core/scene/tree/paged_tree.h"

#include <algorithm>
#include <limits>
#include <unordered_set>
#include <utility>

#include "render_core/base/error.h"

namespace catgs {

std::uint32_t slots_in(std::uint64_t memory_bytes, std::size_t slot_bytes, const TreeShape& shape) {
  return static_cast<std::uint32_t>(std::clamp<std::uint64_t>(
      memory_bytes / slot_bytes, PageChoice::least_slots, PageChoice::slots_for(shape)));
}

PagedTree::PagedTree(std::shared_ptr<PagePool> pool, std::shared_ptr<TreeFile> file,
                     PageStore& store)
    : pool_(std::move(pool)),
      file_(std::move(file)),
      store_(store),
      table_(std::make_shared<PageTable>(file_->shape())),
      number_(pool_->add(*this)) {}

/// The slots come free before the bell rings for the trees that are short of them.
PagedTree::~PagedTree() {
  pool_->remove(number_);
  table_.reset();
  pool_->free()->ring();
}

void PagedTree::open() {
  const std::uint64_t root = shape().page_of(shape().root());
  const Page page = read(root, pool_->free()->take());
  if (!page) throw InputError("", "", file_->damage().first, "convert the scene again");
  publish(std::span(&page, 1), {});
}

std::shared_ptr<const PageTable> PagedTree::table() const {
  pool_->check();
  const std::lock_guard lock(mutex_);
  return table_;
}

std::shared_ptr<Watch> PagedTree::watch() {
  auto watch = std::make_shared<Watch>([free = pool_->free()] { free->ring(); });
  const std::lock_guard lock(mutex_);
  watches_.push_back(watch);
  return watch;
}

/// Those of the Views that are still there.
std::vector<std::shared_ptr<Watch>> PagedTree::watches() const {
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

void PagedTree::settle(const Watch& watch) {
  for (int i = 0; i < pool_->settling_turns() && watch.waits(now_s()) && pool_->turn(); ++i) {
  }
}

PageFigures PagedTree::figures() const {
  PageFigures figures{.unreadable = file_->damage().pages,
                      .slots = pool_->slots(),
                      .free_slots = pool_->free()->count(),
                      .pool_bytes = pool_->bytes()};
  for (const auto& watch : watches()) figures.missing += watch->progress().missing;
  const std::lock_guard lock(mutex_);
  figures.in_memory = static_cast<std::uint32_t>(table_->size());
  figures.loaded = loaded_;
  return figures;
}

std::span<const PagedTree::Seen> PagedTree::look() {
  seen_.clear();
  for (auto& watch : watches()) {
    const auto [demand, number] = watch->demand();
    if (number == 0) continue;  // it has not looked yet
    Cut cut = table_->cut(demand.cameras, demand.detail_px, std::numeric_limits<double>::infinity(),
                          {.part = CutParts::Part::pages});
    // Unreadable pages will not arrive, and need no memory.
    std::erase_if(cut.missing, [this](const PageUse& use) {
      return broken_.contains(family_of(shape(), use.page));
    });
    seen_.push_back({std::move(watch), number, demand.at_once, std::move(cut)});
  }
  return seen_;
}

std::vector<std::uint64_t> PagedTree::change(const PageChanges& changes, ThreadPool& readers) {
  std::vector<std::uint64_t> failed;
  if (!changes.load.empty() || !changes.drop.empty()) {
    const std::vector<Page> loaded = read(changes.load, readers);
    for (std::size_t i = 0; i < loaded.size(); ++i)
      if (!loaded[i]) {
        failed.push_back(changes.load[i]);
        broken_.insert(family_of(shape(), changes.load[i]));
      }
    publish(loaded, changes.drop);
  }
  std::unordered_set<std::uint64_t> changing;
  for (const auto* pages : {&changes.load, &changes.drop, &changes.awaited})
    changing.insert(pages->begin(), pages->end());
  const auto changes_any = [&](const std::vector<PageUse>& uses) {
    return std::ranges::any_of(uses,
                               [&](const PageUse& use) { return changing.contains(use.page); });
  };
  for (const Seen& seen : seen_)
    seen.watch->turned(seen.number, seen.cut, changes.budget_px,
                       (changes.more && !seen.cut.missing.empty()) ||
                           changes_any(seen.cut.missing) || changes_any(seen.cut.used),
                       now_s());
  seen_.clear();
  return failed;
}

/// Publishes the table with these pages more and less. Null pages count as not loaded.
void PagedTree::publish(std::span<const Page> loaded, std::span<const std::uint64_t> dropped) {
  auto next = std::make_shared<PageTable>(*table_);
  next->of_core.reset();
  for (const std::uint64_t page : dropped) next->remove(page);
  const bool at_once = std::ranges::any_of(seen_, &Seen::at_once);
  const double now = now_s();
  std::uint64_t count = 0;
  for (const Page& page : loaded) {
    if (!page) continue;
    page->shown_since_s =
        table_->size() == 0 || at_once ? next->shown_since_above(page->page) : now;
    next->add(page);
    ++count;
  }
  store_.publish(*next);
  std::shared_ptr<const PageTable> now_old = std::move(next);  // goes without the lock
  const std::lock_guard lock(mutex_);
  table_.swap(now_old);
  loaded_ += count;
}

/// Reads pages into free slots. Null stands for each page of a family with a page that cannot be
/// read.
std::vector<PagedTree::Page> PagedTree::read(std::span<const std::uint64_t> numbers,
                                             ThreadPool& readers) {
  std::vector<Page> pages(numbers.size());
  std::vector<std::uint32_t> slots;
  for (std::size_t i = 0; i < numbers.size(); ++i) slots.push_back(pool_->free()->take());
  readers.parallel_for(numbers.size(),
                       [&](std::size_t i) { pages[i] = read(numbers[i], slots[i]); });
  std::unordered_set<std::uint64_t> broken;  // families
  for (std::size_t i = 0; i < pages.size(); ++i)
    if (!pages[i]) broken.insert(family_of(shape(), numbers[i]));
  for (std::size_t i = 0; i < pages.size(); ++i)
    if (broken.contains(family_of(shape(), numbers[i]))) pages[i].reset();
  return pages;
}

PagedTree::Page PagedTree::read(std::uint64_t number, std::uint32_t slot) {
  const std::shared_ptr<void> release(nullptr,
                                      [free = pool_->free(), store = &store_, slot](void*) {
                                        store->release(slot);
                                        free->give_back(slot);
                                      });
  const std::unique_ptr<const TreePage> bytes = file_->page(number, table_->facts_above(number));
  if (!bytes) return nullptr;
  store_.put(slot, *bytes, number);
  auto page = std::make_shared<PageInSlot>();
  page->page = number;
  page->slot = slot;
  page->release = release;
  for (std::size_t s = 0; s < shape().slots(); ++s) page->facts.push_back(bytes->facts(s));
  return page;
}

}  // namespace catgs
