#include "render_core/scene/tree/page_choice.h"

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <vector>

#include <gtest/gtest.h>

namespace catgs::test {
namespace {

/// The pages of trees of one million Gaussians each, as a pool keeps them.
class Memory {
 public:
  explicit Memory(std::uint32_t slots, std::uint32_t trees = 1) : slots_(slots), choice_(slots) {
    for (std::uint32_t tree = 0; tree < trees; ++tree) {
      EXPECT_TRUE(choice_.add(tree, shape_));
      read_root(tree);
    }
  }

  void read_root(std::uint32_t tree) { resident_.insert({tree, 0}); }
  void remove(std::uint32_t tree) {
    choice_.remove(tree);
    std::erase_if(resident_, [=](const PageOfTree& of) { return of.tree == tree; });
  }
  [[nodiscard]] const TreeShape& shape() const { return shape_; }
  [[nodiscard]] const std::set<PageOfTree>& resident() const { return resident_; }
  [[nodiscard]] bool holds(std::uint64_t page, std::uint32_t tree = 0) const {
    return resident_.contains({tree, page});
  }
  [[nodiscard]] std::size_t pages_of(std::uint32_t tree) const {
    return static_cast<std::size_t>(std::ranges::count(resident_, tree, &PageOfTree::tree));
  }
  [[nodiscard]] std::uint32_t free() const {
    return slots_ - static_cast<std::uint32_t>(resident_.size());
  }
  /// Wants the page, and so all pages above, with an error that grows towards the root. Missing
  /// ones below a missing one are not known to a cut.
  void want(std::uint64_t page, float error_px, Cut& cut, std::uint32_t tree = 0) const {
    std::vector<std::uint64_t> path;
    for (; page != 0; page = above(page)) path.push_back(page);
    std::ranges::reverse(path);
    for (std::size_t i = 0; i < path.size(); ++i) {
      const float error = error_px * std::pow(2.0f, static_cast<float>(path.size() - 1 - i));
      const std::uint64_t first = family_of(shape_, path[i]);
      for (std::uint64_t p = first; p < first + family_size(shape_, first); ++p)
        (holds(p, tree) ? cut.used : cut.missing).push_back({p, error});
      if (!holds(path[i], tree)) return;
    }
  }
  void want_all(float error_px, Cut& cut, std::uint32_t tree = 0) const {
    for (std::uint64_t page = 1; page < shape_.pages(); ++page) want(page, error_px, cut, tree);
  }
  [[nodiscard]] std::uint64_t above(std::uint64_t page) const {
    const NodeId root = shape_.root_of(page);
    return shape_.page_of({static_cast<std::uint8_t>(root.level + 1), root.index / 2});
  }
  PageChoice::Step turn(const Cut& cut, std::uint32_t most = 8) {
    return turn(std::map<std::uint32_t, Cut>{{0, cut}}, most);
  }
  PageChoice::Step turn(const std::map<std::uint32_t, Cut>& cuts, std::uint32_t most = 8) {
    choice_.begin(now_s_ += 0.01);
    for (const auto& [tree, cut] : cuts) choice_.note(tree, cut);
    PageChoice::Step step = choice_.next(free(), most);
    EXPECT_LE(step.load.size(), std::min(free(), most));
    for (const PageOfTree& page : step.drop) EXPECT_EQ(resident_.erase(page), 1u);
    for (const PageOfTree& page : step.load) {
      EXPECT_TRUE(resident_.insert(page).second);
      ++loads_[page];
    }
    EXPECT_LE(resident_.size(), slots_);
    for (const auto& [tree, page] : resident_)
      EXPECT_TRUE(page == 0 || holds(above(page), tree)) << "a page without the one above";
    return step;
  }
  PageChoice& choice() { return choice_; }
  [[nodiscard]] int most_loads_of_a_page() const {
    int most = 0;
    for (const auto& [page, count] : loads_) most = std::max(most, count);
    return most;
  }

 private:
  TreeShape shape_{1'000'000, 0};
  std::uint32_t slots_;
  PageChoice choice_;
  std::set<PageOfTree> resident_;
  std::map<PageOfTree, int> loads_;
  double now_s_ = 0.0;
};

TEST(PageChoice, LargestErrorsAreLoadedFirst) {
  Memory memory(1000);
  Cut cut;
  memory.want(9, 1.0f, cut);
  memory.want(3, 5.0f, cut);
  memory.want(5, 3.0f, cut);
  const PageChoice::Step step = memory.turn(cut, 4);
  const TreeShape& shape = memory.shape();
  EXPECT_EQ(step.load, (std::vector<PageOfTree>{{0, family_of(shape, 3)},
                                                {0, family_of(shape, 3) + 1},
                                                {0, family_of(shape, 5)},
                                                {0, family_of(shape, 5) + 1}}));
  EXPECT_TRUE(step.drop.empty());
}

TEST(PageChoice, NothingIsDroppedWhileThereIsRoom) {
  Memory memory(PageChoice::slots_for(TreeShape(1'000'000, 0)));
  for (int turn = 0; turn < 100; ++turn) {
    Cut cut;
    memory.want_all(1.0f, cut);
    EXPECT_TRUE(memory.turn(cut).drop.empty());
  }
  EXPECT_EQ(memory.resident().size(), memory.shape().pages());
  EXPECT_TRUE(memory.turn(Cut()).drop.empty());
}

TEST(PageChoice, UnusedPagesAreDroppedFirst) {
  Memory memory(20);
  const std::uint64_t last = memory.shape().pages() - 1;
  const auto settle = [&](std::uint64_t page, float error_px) {
    for (int turn = 0; turn < 50; ++turn) {
      Cut cut;
      memory.want(page, error_px, cut);
      memory.turn(cut);
    }
    return memory.holds(page);
  };
  // A walk over the last pages, farther than memory reaches.
  for (std::uint64_t page = last; page > last - 40; page -= 2) EXPECT_TRUE(settle(page, 1.0f));
  EXPECT_FALSE(memory.holds(last));
}

TEST(PageChoice, PagesInUseStayUnlessOthersNeedRoomMore) {
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
  EXPECT_TRUE(memory.holds(last - 20));
  EXPECT_FALSE(memory.holds(last));
}

// Slots held by frames become free by themselves, so no further page is dropped for them.
TEST(PageChoice, NoMoreIsDroppedThanIsNeeded) {
  Memory memory(20);
  Cut all;
  for (int turn = 0; turn < 50; ++turn) {
    all = {};
    memory.want_all(1.0f, all);
    memory.turn(all);
  }
  Cut elsewhere;
  memory.want(memory.shape().pages() - 1, 50.0f, elsewhere);
  ASSERT_FALSE(elsewhere.missing.empty());
  memory.choice().begin(10.0);
  memory.choice().note(0, elsewhere);
  const PageChoice::Step first = memory.choice().next(0, 8);
  EXPECT_FALSE(first.drop.empty());
  EXPECT_LE(first.drop.size(), 4u) << "its own room, and the reserve";
  EXPECT_FALSE(first.awaited.empty());
  for (int turn = 1; turn < 10; ++turn) {
    memory.choice().begin(10.0 + turn);
    memory.choice().note(0, elsewhere);
    const PageChoice::Step next = memory.choice().next(0, 8);
    EXPECT_TRUE(next.load.empty());
    EXPECT_TRUE(next.drop.empty());
    EXPECT_EQ(next.awaited, first.awaited);
  }
}

TEST(PageChoice, AFamilyWithAnUnreadablePageIsNotInMemory) {
  Memory memory(100);
  Cut cut;
  memory.want(1, 4.0f, cut);
  memory.choice().begin(1.0);
  memory.choice().note(0, cut);
  EXPECT_EQ(memory.choice().next(99, 8).load.size(), 2u);
  memory.choice().failed({0, 1});
  memory.choice().failed({0, 2});
  memory.choice().begin(2.0);
  memory.choice().note(0, cut);
  EXPECT_EQ(memory.choice().next(99, 8).load.size(), 2u);
}

TEST(PageChoice, RulesHoldForAnyRequests) {
  std::mt19937_64 random(4);
  for (const std::uint32_t slots : {PageChoice::least_slots, 9u, 40u}) {
    Memory memory(slots, 2);
    for (int turn = 0; turn < 300; ++turn) {
      std::map<std::uint32_t, Cut> cuts;
      for (int i = 0; i < 10; ++i) {
        const auto tree = static_cast<std::uint32_t>(random() % 2);
        memory.want(1 + random() % (memory.shape().pages() - 1),
                    std::uniform_real_distribution<float>(0.1f, 10.0f)(random), cuts[tree], tree);
      }
      memory.turn(cuts, 1 + static_cast<std::uint32_t>(random() % 10));
    }
  }
}

// Errors grow towards the root, but a forged file may say something else.
TEST(PageChoice, RulesHoldForForgedErrors) {
  Memory memory(PageChoice::least_slots);  // one family fits
  Cut first;
  memory.want(1, 1.0f, first);
  memory.turn(first);
  ASSERT_TRUE(memory.holds(1));
  std::uint64_t below = 2;
  while (memory.above(below) != 1) ++below;
  Cut forged;
  forged.used.push_back({1, 1.0f});
  forged.missing.push_back({below, 100.0f});
  for (int turn = 0; turn < 3; ++turn) memory.turn(forged);
  EXPECT_FALSE(memory.holds(below)) << "the page above made room for it";
}

// Requests at rest, for far more than there is room for: memory fills, comes to rest, and nothing
// is read twice on the way.
TEST(PageChoice, NothingIsLoadedTwiceAtRest) {
  std::mt19937_64 random(8);
  for (const std::uint32_t slots : {6u, 11u, 50u, 120u}) {
    Memory memory(slots, 2);
    std::vector<float> error;
    for (std::uint64_t page = 0; page < 2 * memory.shape().pages(); ++page)
      error.push_back(std::uniform_real_distribution<float>(0.1f, 10.0f)(random));
    std::size_t rests = 0;
    for (int turn = 0; turn < 400 && rests < 5; ++turn) {
      std::map<std::uint32_t, Cut> cuts;
      std::size_t i = 0;
      for (const std::uint32_t tree : {0u, 1u})
        for (std::uint64_t page = 1; page < memory.shape().pages(); ++page)
          memory.want(page, error[i++], cuts[tree], tree);
      const PageChoice::Step step = memory.turn(cuts);
      rests = step.load.empty() && step.drop.empty() ? rests + 1 : 0;
    }
    EXPECT_EQ(rests, 5u) << slots << " slots";
    EXPECT_EQ(memory.most_loads_of_a_page(), 1) << slots << " slots";
    EXPECT_GE(memory.resident().size() + 4, std::min<std::size_t>(slots, memory.shape().pages()));
  }
}

TEST(PageChoice, TreesGetWhatTheirErrorsAreWorth) {
  Memory memory(42, 2);
  const auto settle = [&](float first_px, float second_px) {
    for (int turn = 0; turn < 100; ++turn) {
      std::map<std::uint32_t, Cut> cuts;
      if (first_px > 0.0f) memory.want_all(first_px, cuts[0], 0);
      if (second_px > 0.0f) memory.want_all(second_px, cuts[1], 1);
      memory.turn(cuts);
    }
  };
  settle(1.0f, 1.0f);
  EXPECT_GT(memory.pages_of(0), 4u);
  EXPECT_GT(memory.pages_of(1), 4u);
  settle(1.0f, 100.0f);
  EXPECT_LE(memory.pages_of(0), 4u);
  EXPECT_GE(memory.pages_of(1), 36u);
  settle(1.0f, 0.0f);
  EXPECT_GE(memory.pages_of(0), 36u) << "an idle tree gives its pages up";
  EXPECT_LE(memory.pages_of(1), 4u);
  EXPECT_TRUE(memory.holds(0, 1)) << "the root stays";
}

TEST(PageChoice, ANewTreeGetsARootAndALeavingOneGivesAllBack) {
  Memory memory(13);
  const auto want_all = [&](std::uint32_t tree) {
    Cut cut;
    memory.want_all(1.0f, cut, tree);
    return cut;
  };
  for (int turn = 0; turn < 50; ++turn) memory.turn(want_all(0));
  EXPECT_EQ(memory.free(), 0u);
  ASSERT_TRUE(memory.choice().add(1, memory.shape()));
  const PageChoice::Step step = memory.turn(want_all(0));
  EXPECT_EQ(step.drop.size(), 2u) << "the root needs a slot";
  EXPECT_TRUE(step.load.empty());
  memory.read_root(1);
  memory.remove(0);
  for (int turn = 0; turn < 50; ++turn) memory.turn({{1, want_all(1)}});
  EXPECT_GE(memory.pages_of(1), 12u);
}

TEST(PageChoice, MoreTreesThanCanBeDrawnAreRefused) {
  Memory memory(4, 2);
  EXPECT_FALSE(memory.choice().add(2, memory.shape()));
}

}  // namespace
}  // namespace catgs::test
