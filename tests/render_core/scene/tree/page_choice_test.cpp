#include "render_core/scene/tree/page_choice.h"

#include <algorithm>
#include <random>
#include <set>
#include <vector>

#include <gtest/gtest.h>

namespace catgs::test {
namespace {

/// The pages of a tree of one million Gaussians, as a pager keeps them.
class Memory {
 public:
  explicit Memory(std::uint32_t slots) : slots_(slots), choice_(shape_, slots) {
    resident_.insert(0);
  }

  [[nodiscard]] const TreeShape& shape() const { return shape_; }
  [[nodiscard]] const std::set<std::uint64_t>& resident() const { return resident_; }
  [[nodiscard]] std::uint32_t free() const {
    return slots_ - static_cast<std::uint32_t>(resident_.size());
  }
  /// Wants the page, and so all pages above, with an error that grows towards the root. Missing
  /// ones below a missing one are not known to a cut.
  void want(std::uint64_t page, float error_px, Cut& cut) const {
    std::vector<std::uint64_t> path;
    for (; page != 0; page = above(page)) path.push_back(page);
    std::ranges::reverse(path);
    for (std::size_t i = 0; i < path.size(); ++i) {
      const float error = error_px * std::pow(2.0f, static_cast<float>(path.size() - 1 - i));
      const std::uint64_t first = choice_.family_of(path[i]);
      for (std::uint64_t p = first; p < first + 2 && choice_.family_of(p) == first; ++p)
        (resident_.contains(p) ? cut.used : cut.missing).push_back({p, error});
      if (!resident_.contains(path[i])) return;
    }
  }
  [[nodiscard]] std::uint64_t above(std::uint64_t page) const {
    const NodeId root = shape_.root_of(page);
    return shape_.page_of({static_cast<std::uint8_t>(root.level + 1), root.index / 2});
  }
  PageChoice::Step turn(const Cut& cut, std::uint32_t most = 8) {
    choice_.begin(now_s_ += 0.01);
    choice_.note(cut);
    PageChoice::Step step = choice_.next(free(), 0, most);
    EXPECT_LE(step.load.size(), std::min(free(), most));
    for (const std::uint64_t page : step.drop) EXPECT_EQ(resident_.erase(page), 1u);
    for (const std::uint64_t page : step.load) EXPECT_TRUE(resident_.insert(page).second);
    EXPECT_LE(resident_.size(), slots_);
    for (const std::uint64_t page : resident_)
      EXPECT_TRUE(page == 0 || resident_.contains(above(page))) << "a page without the one above";
    return step;
  }
  PageChoice& choice() { return choice_; }

 private:
  TreeShape shape_{1'000'000, 0};
  std::uint32_t slots_;
  PageChoice choice_;
  std::set<std::uint64_t> resident_;
  double now_s_ = 0.0;
};

TEST(PageChoice, LoadsTheLargestErrorsFirst) {
  Memory memory(1000);
  Cut cut;
  memory.want(9, 1.0f, cut);
  memory.want(3, 5.0f, cut);
  memory.want(5, 3.0f, cut);
  const PageChoice::Step step = memory.turn(cut, 4);
  EXPECT_EQ(step.load, (std::vector<std::uint64_t>{
                           memory.choice().family_of(3), memory.choice().family_of(3) + 1,
                           memory.choice().family_of(5), memory.choice().family_of(5) + 1}));
  EXPECT_TRUE(step.drop.empty());
}

TEST(PageChoice, WithRoomForAllNothingGoes) {
  Memory memory(1000);
  for (int turn = 0; turn < 100; ++turn) {
    Cut cut;
    for (std::uint64_t page = 1; page < memory.shape().pages(); ++page)
      memory.want(page, 1.0f, cut);
    EXPECT_TRUE(memory.turn(cut).drop.empty());
  }
  EXPECT_EQ(memory.resident().size(), memory.shape().pages());
  EXPECT_TRUE(memory.turn({}).drop.empty());
}

TEST(PageChoice, ShortOfRoomTheUnusedGoFirst) {
  Memory memory(20);
  const std::uint64_t last = memory.shape().pages() - 1;
  const auto settle = [&](std::uint64_t page, float error_px) {
    for (int turn = 0; turn < 50; ++turn) {
      Cut cut;
      memory.want(page, error_px, cut);
      memory.turn(cut);
    }
    return memory.resident().contains(page);
  };
  // A walk over the last pages, farther than memory reaches.
  for (std::uint64_t page = last; page > last - 40; page -= 2) EXPECT_TRUE(settle(page, 1.0f));
  EXPECT_FALSE(memory.resident().contains(last));
}

TEST(PageChoice, ThoseInUseStayUnlessOthersNeedItClearlyMore) {
  Memory memory(12);
  const std::uint64_t last = memory.shape().pages() - 1;
  const auto settle = [&](float error_px, float other_px) {
    std::size_t changes = 0;
    for (int turn = 0; turn < 60; ++turn) {
      Cut cut;
      for (std::uint64_t i = 0; i < 8; i += 2) memory.want(last - i, error_px, cut);
      for (std::uint64_t i = 20; i < 28; i += 2) memory.want(last - i, other_px, cut);
      const PageChoice::Step step = memory.turn(cut);
      if (turn >= 50) changes += step.load.size() + step.drop.size();
    }
    EXPECT_EQ(changes, 0u) << "pages come and go though nothing changes";
  };
  settle(2.0f, 2.1f);
  settle(2.0f, 50.0f);
  EXPECT_TRUE(memory.resident().contains(last - 20));
  EXPECT_FALSE(memory.resident().contains(last));
}

// Slots that frames hold come free by themselves, so nothing more is dropped for want of them.
TEST(PageChoice, NoMoreIsDroppedThanIsNeeded) {
  Memory memory(20);
  Cut all;
  for (std::uint64_t page = 1; page < memory.shape().pages(); ++page) memory.want(page, 1.0f, all);
  for (int turn = 0; turn < 50; ++turn) memory.turn(all);
  Cut elsewhere;
  memory.want(memory.shape().pages() - 1, 50.0f, elsewhere);
  memory.choice().begin(10.0);
  memory.choice().note(elsewhere);
  const PageChoice::Step first = memory.choice().next(0, 0, 8);
  EXPECT_FALSE(first.drop.empty());
  const auto held = static_cast<std::uint32_t>(first.drop.size());
  for (int turn = 1; turn < 10; ++turn) {
    memory.choice().begin(10.0 + turn);
    memory.choice().note(elsewhere);
    const PageChoice::Step next = memory.choice().next(0, held, 8);
    EXPECT_TRUE(next.load.empty());
    EXPECT_TRUE(next.drop.empty());
  }
}

TEST(PageChoice, UnreadablePagesAreAskedForOnce) {
  Memory memory(100);
  Cut cut;
  memory.want(1, 4.0f, cut);
  memory.choice().begin(1.0);
  memory.choice().note(cut);
  EXPECT_EQ(memory.choice().next(99, 0, 8).load.size(), 2u);
  memory.choice().failed(1);
  memory.choice().begin(2.0);
  memory.choice().note(cut);
  EXPECT_TRUE(memory.choice().next(99, 0, 8).load.empty());
}

TEST(PageChoice, AnyWishesKeepItsRules) {
  std::mt19937_64 random(4);
  for (const std::uint32_t slots : {PageChoice::least_slots, 9u, 40u}) {
    Memory memory(slots);
    for (int turn = 0; turn < 300; ++turn) {
      Cut cut;
      for (int i = 0; i < 10; ++i)
        memory.want(1 + random() % (memory.shape().pages() - 1),
                    std::uniform_real_distribution<float>(0.1f, 10.0f)(random), cut);
      memory.turn(cut, 1 + static_cast<std::uint32_t>(random() % 10));
    }
  }
}

}  // namespace
}  // namespace catgs::test
