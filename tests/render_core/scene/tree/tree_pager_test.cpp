#include "render_core/scene/tree/tree_pager.h"

#include <atomic>
#include <chrono>
#include <map>
#include <set>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "tests/render_core/scene/tree/tree_test_support.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {
namespace {

/// Slots that remember which page they hold, and refuse one that a frame may still read.
class RecordingStore final : public PageStore {
 public:
  explicit RecordingStore(std::uint32_t slots) : held_(slots), readers_(slots) {}

  [[nodiscard]] std::uint32_t slots() const override {
    return static_cast<std::uint32_t>(held_.size());
  }
  void put(std::uint32_t slot, const TreePage& page, std::uint64_t number) override {
    if (broken) throw std::runtime_error("the device is lost");
    EXPECT_EQ(readers_[slot].load(), 0) << "slot " << slot << " is being read";
    EXPECT_GT(page.facts(0).count, 0u);
    held_[slot] = number;
  }
  void publish(PageTable& table) override {
    for (const auto& page : table.pages())
      if (page) {
        EXPECT_EQ(held_[page->slot].load(), page->page);
      }
    ++published_;
  }
  /// Reads all slots of a table, as a frame does.
  void read(const PageTable& table) {
    for (const auto& page : table.pages())
      if (page) ++readers_[page->slot];
    std::this_thread::yield();
    for (const auto& page : table.pages())
      if (page) {
        EXPECT_EQ(held_[page->slot].load(), page->page);
        --readers_[page->slot];
      }
  }
  [[nodiscard]] int published() const { return published_; }

  std::atomic<bool> broken{false};

 private:
  std::vector<std::atomic<std::uint64_t>> held_;
  std::vector<std::atomic<int>> readers_;
  std::atomic<int> published_{0};
};

Camera camera_at(float x, float z) {
  return make_camera(look_at({x, 0, z}, {x, 0, z + 5}), {320, 240}, 300.0f);
}

std::shared_ptr<TreeFile> tree_of(std::string bytes) {
  return std::make_shared<TreeFile>(source_of(std::move(bytes)), std::size_t{1} << 24);
}

class TreePagerTest : public testing::Test {
 protected:
  ThreadPool pool_{2};
  std::string bytes_ = tree_bytes(random_cloud(60'000, 0, 11), pool_);
};

TEST_F(TreePagerTest, SettlesToWhatTheCameraNeeds) {
  RecordingStore store(64);
  TreePager pager(tree_of(bytes_), store);
  EXPECT_EQ(pager.table()->size(), 1u);
  const Camera camera = camera_at(0, -6);
  pager.settle({{camera}, 0.0f});
  const Cut cut = pager.table()->cut(std::span(&camera, 1), 0.0f, pager.now_s());
  EXPECT_TRUE(cut.missing.empty());
  EXPECT_GT(cut.drawn.size(), 0u);
  for (const auto& [node, share] : cut.drawn) {
    EXPECT_EQ(node.level, 0);
    EXPECT_EQ(share, 1.0f);
  }
  EXPECT_EQ(pager.stats().loaded, pager.stats().in_memory);
}

TEST_F(TreePagerTest, ShortOfMemoryIsCoarserAndHasNoHole) {
  RecordingStore store(PageChoice::least_slots);
  TreePager pager(tree_of(bytes_), store);
  const Camera camera = camera_at(0, -6);
  pager.settle({{camera}, 0.0f});
  EXPECT_LE(pager.table()->size(), store.slots());
  const TreeShape& shape = pager.shape();
  const Cut some = pager.table()->cut(std::span(&camera, 1), 0.0f, pager.now_s());
  EXPECT_FALSE(some.missing.empty());

  RecordingStore large(64);
  TreePager all_pages(tree_of(bytes_), large);
  all_pages.settle({{camera}, 0.0f});
  const Cut all = all_pages.table()->cut(std::span(&camera, 1), 0.0f, all_pages.now_s());
  std::map<std::uint32_t, float> stood_for;
  for (const auto& [node, share] : some.drawn)
    for (std::uint32_t l = node.index << node.level;
         l < std::min(shape.leaves(), (node.index + 1) << node.level); ++l)
      stood_for[l] += share;
  for (const auto& [leaf, share] : all.drawn) EXPECT_NEAR(stood_for[leaf.index], share, 1e-4f);
}

TEST_F(TreePagerTest, FramesKeepWhatTheyReadWhileTheCameraMoves) {
  RecordingStore store(8);
  TreePager pager(tree_of(bytes_), store);
  const auto watch = pager.watch();
  const auto fly = [&](float x) {
    for (int i = 0; i < 400; ++i) {
      watch->look({{camera_at(x, -6.0f + 0.05f * static_cast<float>(i))}, 0.2f});
      store.read(*pager.table());
    }
  };
  std::thread other(fly, 1.0f);
  fly(-1.0f);
  other.join();
}

// A frame that holds its pages for long holds up the others, but takes nothing from them.
TEST_F(TreePagerTest, PagesThatAFrameHoldsCostNoOthers) {
  RecordingStore store(8);
  TreePager pager(tree_of(bytes_), store);
  pager.settle({{camera_at(-2, -6)}, 0.0f});
  const std::size_t full = pager.table()->size();
  auto held = pager.table();
  for (int i = 0; i < 20; ++i) pager.settle({{camera_at(2, 5)}, 0.0f});
  EXPECT_GE(pager.table()->size() + 6, full);
  held.reset();
  pager.settle({{camera_at(2, 5)}, 0.0f});
  EXPECT_GE(pager.table()->size() + 3, full);
}

TEST_F(TreePagerTest, BlendsInAndComesToRest) {
  RecordingStore store(64);
  TreePager pager(tree_of(bytes_), store);
  const auto watch = pager.watch();
  const Camera camera = camera_at(0, -6);
  watch->look({{camera}, 0.5f});
  EXPECT_TRUE(watch->waits(pager.now_s()));
  while (watch->waits(pager.now_s())) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_EQ(watch->missing(), 0u);
  EXPECT_EQ(watch->coarsest_px(), 0.0f);
  const int published = store.published();
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  EXPECT_EQ(store.published(), published);
}

TEST_F(TreePagerTest, DamagedPagesCostDetailOnly) {
  const TreeShape shape = tree_of(bytes_)->shape();
  bytes_[shape.page_offset(1) + 200] ^= 1;
  RecordingStore store(64);
  const auto tree = tree_of(bytes_);
  TreePager pager(tree, store);
  pager.settle({{}, 0.0f});
  const Camera camera = camera_at(0, -6);
  pager.settle({{camera}, 0.0f});
  EXPECT_EQ(pager.stats().unreadable, 1u);
  EXPECT_EQ(pager.table()->find(1), nullptr);
  const Cut cut = pager.table()->cut(std::span(&camera, 1), 0.0f, pager.now_s());
  EXPECT_FALSE(cut.drawn.empty());
  EXPECT_FALSE(cut.missing.empty());
}

TEST_F(TreePagerTest, ACoreThatFailsFailsTheNextFrame) {
  RecordingStore store(64);
  TreePager pager(tree_of(bytes_), store);
  store.broken = true;
  const auto watch = pager.watch();
  watch->look({{camera_at(0, -6)}, 0.0f});
  const auto failed = [&] {
    try {
      (void)pager.table();
      return false;
    } catch (const std::runtime_error&) {
      return true;
    }
  };
  for (int i = 0; i < 1000 && !failed(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_TRUE(failed());
}

TEST_F(TreePagerTest, WithoutTheRootThereIsNothing) {
  bytes_[tree_of(bytes_)->shape().page_offset(0) + 200] ^= 1;
  RecordingStore store(64);
  EXPECT_THROW(TreePager(tree_of(bytes_), store), InputError);
}

}  // namespace
}  // namespace catgs::test
