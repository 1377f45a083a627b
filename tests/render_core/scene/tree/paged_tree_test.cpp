#include "render_core/scene/tree/paged_tree.h"

#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "tests/render_core/scene/tree/tree_test_support.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {
namespace {

/// The slots of a pool, as frames read them.
struct Slots {
  explicit Slots(std::uint32_t count)
      : readers(count), pool(std::make_shared<PagePool>(count, 1000 * count)) {}

  std::vector<std::atomic<int>> readers;
  std::shared_ptr<PagePool> pool;
};

/// A tree's pages, which remember the slots that hold them, and refuse one that a frame may still
/// read.
class RecordingStore final : public PageStore {
 public:
  explicit RecordingStore(Slots& slots)
      : slots_(slots), held_(slots.readers.size()), has_memory_(slots.readers.size()) {}

  void put(std::uint32_t slot, const TreePage& page, std::uint64_t number) override {
    if (broken) throw std::runtime_error("the device is lost");
    EXPECT_EQ(slots_.readers[slot].load(), 0) << "slot " << slot << " is being read";
    EXPECT_GT(page.facts(0).count, 0u);
    held_[slot] = number;
    has_memory_[slot] = true;
    const std::lock_guard lock(mutex_);
    ++loads_[number];
  }
  void publish(PageTable& table) override {
    for (const auto& page : table.pages()) EXPECT_EQ(held_[page->slot].load(), page->page);
    ++published_;
  }
  void release(std::uint32_t slot) override {
    EXPECT_EQ(slots_.readers[slot].load(), 0) << "slot " << slot << " is being read";
    held_[slot] = ~std::uint64_t{0};
    has_memory_[slot] = false;
    ++released_;
  }
  [[nodiscard]] bool has_memory(std::uint32_t slot) const { return has_memory_[slot]; }
  [[nodiscard]] int released() const { return released_; }
  /// Reads all slots of a table, as a frame does.
  void read(const PageTable& table) {
    for (const auto& page : table.pages()) ++slots_.readers[page->slot];
    std::this_thread::yield();
    for (const auto& page : table.pages()) {
      EXPECT_EQ(held_[page->slot].load(), page->page);
      --slots_.readers[page->slot];
    }
  }
  [[nodiscard]] int published() const { return published_; }
  [[nodiscard]] int most_loads_of_a_page() {
    const std::lock_guard lock(mutex_);
    int most = 0;
    for (const auto& [page, count] : loads_) most = std::max(most, count);
    return most;
  }

  std::atomic<bool> broken{false};

 private:
  Slots& slots_;
  std::vector<std::atomic<std::uint64_t>> held_;
  std::vector<std::atomic<bool>> has_memory_;
  std::atomic<int> released_{0};
  std::mutex mutex_;
  std::map<std::uint64_t, int> loads_;
  std::atomic<int> published_{0};
};

Camera camera_at(float x, float z) {
  return make_camera(look_at({x, 0, z}, {x, 0, z + 5}), {320, 240}, 300.0f);
}

std::shared_ptr<TreeFile> tree_of(std::string bytes) {
  return std::make_shared<TreeFile>(source_of(std::move(bytes)));
}

/// A tree in a pool, as one View looks at it.
struct Looked {
  Looked(Slots& slots, std::shared_ptr<TreeFile> file)
      : store(slots), tree(slots.pool, std::move(file), store), watch(tree.watch()) {}

  void settle(const Camera& camera, float detail_px = 0.0f) {
    watch->look({{camera}, detail_px, true});
    tree.settle(*watch);
  }
  /// What is drawn when pages are blended in.
  [[nodiscard]] Cut cut(const Camera& camera, float detail_px = 0.0f) const {
    return tree.table()->cut(std::span(&camera, 1), detail_px, 1e9);
  }
  [[nodiscard]] bool comes_to_rest() const {
    for (int i = 0; i < 1000 && watch->waits(tree.now_s()); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return !watch->waits(tree.now_s());
  }

  RecordingStore store;
  PagedTree tree;
  std::shared_ptr<Watch> watch;
};

class PagedTreeTest : public testing::Test {
 protected:
  [[nodiscard]] std::shared_ptr<TreeFile> tree() const { return tree_of(bytes_); }

  ThreadPool pool_{2};
  std::string bytes_ = tree_bytes(random_cloud(60'000, 0, 11), pool_);
};

TEST_F(PagedTreeTest, MemoryOfASlotStaysWithItsTreeUntilAnotherTakesIt) {
  constexpr std::uint32_t count = 9;
  Slots slots(count);
  Looked first(slots, tree());
  first.settle(camera_at(0, -6));
  EXPECT_EQ(first.tree.table()->size(), count);
  Looked second(slots, tree());
  EXPECT_EQ(first.tree.table()->size(), count - 2);
  EXPECT_EQ(first.store.released(), 1) << "the second root takes one of the two slots";
  first.watch.reset();
  second.settle(camera_at(0, -6));
  EXPECT_GT(first.store.released(), 1);
  for (std::uint32_t slot = 0; slot < count; ++slot)
    EXPECT_FALSE(first.store.has_memory(slot) && second.store.has_memory(slot)) << slot;
}

TEST_F(PagedTreeTest, TreesSettleToWhatTheCameraNeeds) {
  Slots slots(64);
  Looked looked(slots, tree());
  EXPECT_EQ(looked.tree.table()->size(), 1u);
  const Camera camera = camera_at(0, -6);
  looked.settle(camera);
  const Cut cut = looked.tree.table()->cut(std::span(&camera, 1), 0.0f, looked.tree.now_s());
  EXPECT_TRUE(cut.missing.empty());
  EXPECT_GT(cut.drawn.size(), 0u);
  for (const auto& [node, share] : cut.drawn) {
    EXPECT_EQ(node.level, 0);
    EXPECT_EQ(share, 1.0f);
  }
  const PageFigures figures = looked.tree.figures();
  EXPECT_EQ(figures.loaded, figures.in_memory);
  EXPECT_EQ(figures.missing, 0u);
  EXPECT_EQ(figures.slots, 64u);
  EXPECT_EQ(figures.free_slots, 64u - figures.in_memory);
  EXPECT_EQ(figures.pool_bytes, 64'000u);
}

TEST_F(PagedTreeTest, ShortMemoryCostsDetailAndLeavesNoHole) {
  Slots few(PageChoice::least_slots), many(64);
  Looked short_of_memory(few, tree()), all_pages(many, tree());
  const Camera camera = camera_at(0, -6);
  short_of_memory.settle(camera);
  all_pages.settle(camera);
  EXPECT_LE(short_of_memory.tree.table()->size(), few.pool->slots());
  const Cut some = short_of_memory.cut(camera), all = all_pages.cut(camera);
  EXPECT_FALSE(some.missing.empty());
  EXPECT_EQ(short_of_memory.tree.figures().missing, 0u) << "none has room";
  EXPECT_GT(short_of_memory.watch->progress().coarsest_px, 0.0f);
  const TreeShape& shape = all_pages.tree.shape();
  std::map<std::uint32_t, float> stood_for;
  for (const auto& [node, share] : some.drawn)
    for (std::uint32_t l = node.index << node.level;
         l < std::min(shape.leaves(), (node.index + 1) << node.level); ++l)
      stood_for[l] += share;
  for (const auto& [leaf, share] : all.drawn) EXPECT_NEAR(stood_for[leaf.index], share, 1e-4f);
}

TEST_F(PagedTreeTest, FramesKeepWhatTheyReadWhileTheCameraMoves) {
  Slots slots(8);
  Looked a(slots, tree()), b(slots, tree());
  const auto fly = [](Looked& looked, float x) {
    for (int i = 0; i < 300; ++i) {
      looked.watch->look({{camera_at(x, -6.0f + 0.05f * static_cast<float>(i))}, 0.2f});
      looked.store.read(*looked.tree.table());
    }
  };
  std::thread other(fly, std::ref(a), 1.0f);
  fly(b, -1.0f);
  other.join();
}

// A frame that holds its pages for long holds up the others, but takes nothing from them.
TEST_F(PagedTreeTest, PagesThatAFrameHoldsCostNoOthers) {
  Slots slots(9);
  Looked looked(slots, tree());
  looked.settle(camera_at(-2, -6));
  const std::size_t full = looked.tree.table()->size();
  auto held = looked.tree.table();
  for (int i = 0; i < 20; ++i) looked.settle(camera_at(2, 5));
  EXPECT_GE(looked.tree.table()->size() + 6, full);
  held.reset();
  looked.watch->look({{camera_at(2, 5)}, 0.01f});
  looked.tree.settle(*looked.watch);
  EXPECT_GE(looked.tree.table()->size() + 3, full);
}

TEST_F(PagedTreeTest, DetailBlendsInAndComesToRest) {
  Slots slots(64);
  Looked looked(slots, tree());
  looked.watch->look({{camera_at(0, -6)}, 0.5f});
  EXPECT_TRUE(looked.watch->waits(looked.tree.now_s()));
  EXPECT_TRUE(looked.comes_to_rest());
  EXPECT_EQ(looked.watch->progress().missing, 0u);
  EXPECT_EQ(looked.watch->progress().coarsest_px, 0.0f);
  const int published = looked.store.published();
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  EXPECT_EQ(looked.store.published(), published);
}

// Far fewer slots than the cuts need, two trees, and a View of each at rest.
TEST_F(PagedTreeTest, ViewsThatCompeteComeToRestAndNothingIsLoadedTwice) {
  for (const std::uint32_t count : {6u, 9u, 14u}) {
    Slots slots(count);
    Looked a(slots, tree()), b(slots, tree_of(tree_bytes(random_cloud(40'000, 2, 12), pool_)));
    a.watch->look({{camera_at(-1, -6)}, 0.0f});
    b.watch->look({{camera_at(1, -7)}, 0.0f});
    EXPECT_TRUE(a.comes_to_rest());
    EXPECT_TRUE(b.comes_to_rest());
    EXPECT_EQ(a.watch->progress().missing + b.watch->progress().missing, 0u);
    EXPECT_GT(a.watch->progress().coarsest_px + b.watch->progress().coarsest_px, 0.0f);
    EXPECT_EQ(a.store.most_loads_of_a_page(), 1);
    EXPECT_EQ(b.store.most_loads_of_a_page(), 1);
    const int published = a.store.published() + b.store.published();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    EXPECT_EQ(a.store.published() + b.store.published(), published);
  }
}

TEST_F(PagedTreeTest, AnIdleTreeGivesItsPagesUp) {
  Slots slots(12);
  Looked a(slots, tree()), b(slots, tree());
  const Camera camera = camera_at(0, -6);
  a.settle(camera);
  const std::size_t alone = a.tree.table()->size();
  EXPECT_GT(alone, 8u);
  a.watch.reset();  // its View ends
  b.settle(camera);
  EXPECT_EQ(b.tree.table()->size(), alone);
  EXPECT_LE(a.tree.table()->size(), 3u);
  EXPECT_GE(a.tree.table()->size(), 1u);
}

// A View at rest has the pages that fitted into memory. It is woken when others free more.
TEST_F(PagedTreeTest, ViewsAtRestLearnOfRoom) {
  Slots slots(12);
  Looked a(slots, tree()), b(slots, tree());
  // The first to rest keeps its pages against requests of the same errors.
  b.watch->look({{camera_at(0, -6)}, 0.0f});
  ASSERT_TRUE(b.comes_to_rest());
  a.watch->look({{camera_at(0, -6)}, 0.0f});
  ASSERT_TRUE(a.comes_to_rest());
  ASSERT_TRUE(b.comes_to_rest());
  ASSERT_GT(a.watch->progress().coarsest_px, 0.0f);
  ASSERT_GT(b.tree.table()->size(), 1u);
  const std::uint64_t changes = a.watch->progress().changes;
  b.watch.reset();
  for (int i = 0; i < 1000 && a.watch->progress().changes == changes; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_GT(a.watch->progress().changes, changes);
  EXPECT_TRUE(a.comes_to_rest());
}

TEST_F(PagedTreeTest, ATreeThatGoesFreesItsSlots) {
  Slots slots(12);
  Looked a(slots, tree());
  const Camera camera = camera_at(0, -6);
  {
    Looked b(slots, tree());
    b.settle(camera);
    EXPECT_LE(slots.pool->free()->count(), 2u);
    const auto held = b.tree.table();
    b.watch.reset();
  }
  EXPECT_EQ(slots.pool->free()->count(), 11u);
  a.settle(camera);
  EXPECT_GE(a.tree.table()->size(), 10u);
}

TEST_F(PagedTreeTest, ATreeThatFindsTheMemoryFullGetsARoot) {
  Slots slots(9);
  Looked a(slots, tree());
  const Camera camera = camera_at(0, -6);
  a.settle(camera);
  EXPECT_EQ(slots.pool->free()->count(), 0u);
  Looked b(slots, tree());
  EXPECT_EQ(b.tree.table()->size(), 1u);
  EXPECT_EQ(a.tree.table()->size(), 7u);
}

TEST_F(PagedTreeTest, TooManyTreesAreRefused) {
  Slots slots(4);
  Looked a(slots, tree()), b(slots, tree());
  EXPECT_THROW(Looked(slots, tree()), InputError);
  b.settle(camera_at(0, -6));
  EXPECT_EQ(b.tree.table()->size(), 3u);
}

TEST_F(PagedTreeTest, DamagedPagesCostDetailOfTheirTreeOnly) {
  Slots slots(64);
  Looked sound(slots, tree());
  const TreeShape shape = tree()->shape();
  bytes_[shape.page_offset(1) + 200] ^= 1;
  Looked damaged(slots, tree());
  damaged.watch->look({{}, 0.0f, true});
  const Camera camera = camera_at(0, -6);
  sound.settle(camera);
  damaged.settle(camera);
  EXPECT_EQ(damaged.tree.figures().unreadable, 1u);
  EXPECT_EQ(damaged.tree.table()->find(1), nullptr);
  EXPECT_FALSE(damaged.cut(camera).drawn.empty());
  EXPECT_FALSE(damaged.cut(camera).missing.empty());
  EXPECT_TRUE(damaged.comes_to_rest());
  EXPECT_EQ(damaged.tree.figures().missing, 0u) << "no memory is short of it";
  EXPECT_EQ(sound.tree.figures().unreadable, 0u);
  EXPECT_TRUE(sound.cut(camera).missing.empty());
}

TEST_F(PagedTreeTest, PagesThatExceedTheNodeAboveAreNotUsed) {
  Slots slots(64);
  Looked forged(slots,
                tree_of(with_page(bytes_, 1, [](TreePage& page) { page.facts(0).error = 1e8f; })));
  forged.settle(camera_at(0, -6));
  EXPECT_EQ(forged.tree.figures().unreadable, 1u);
  EXPECT_EQ(forged.tree.table()->find(1), nullptr);
  EXPECT_GT(forged.tree.table()->size(), 1u);
}

TEST_F(PagedTreeTest, ACoreThatFailsFailsTheNextFrame) {
  Slots slots(64);
  Looked looked(slots, tree());
  looked.store.broken = true;
  looked.watch->look({{camera_at(0, -6)}, 0.0f});
  const auto failed = [&] {
    try {
      (void)looked.tree.table();
      return false;
    } catch (const std::runtime_error&) {
      return true;
    }
  };
  for (int i = 0; i < 1000 && !failed(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_TRUE(failed());
}

TEST_F(PagedTreeTest, DamagedRootsAreRefusedAndTakeNoRoom) {
  Slots slots(64);
  {
    std::string damaged = bytes_;
    damaged[tree()->shape().page_offset(0) + 200] ^= 1;
    EXPECT_THROW(Looked(slots, tree_of(damaged)), InputError);
  }
  EXPECT_EQ(slots.pool->free()->count(), 64u);
  EXPECT_EQ(Looked(slots, tree()).tree.table()->size(), 1u);
}

}  // namespace
}  // namespace catgs::test
