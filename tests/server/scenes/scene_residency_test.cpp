#include "server/scenes/scene_residency.h"

#include "tests/support/test.h"

namespace catgs::test {
namespace {

using Answer = SceneResidency::Answer;

class SceneResidencyTest : public testing::Test {
 protected:
  explicit SceneResidencyTest(std::uint64_t pool_bytes = 0)
      : residency_({.budget_bytes = 100, .pool_bytes = pool_bytes, .min_residency = 60s}) {}
  Answer want(const std::string& id, std::uint64_t bytes) {
    return residency_.want(id, bytes, now_, use_of_);
  }
  std::optional<SceneResidency::Step> next() { return residency_.next(now_, use_of_); }
  /// It is wanted, loaded and left.
  void visit(const std::string& id, std::uint64_t bytes) {
    ASSERT_EQ(want(id, bytes), Answer::awaited) << id;
    const auto step = next();
    ASSERT_TRUE(step && step->load == id) << id;
    residency_.loaded(id, bytes, now_);
  }

  TimePoint now_{};
  std::set<std::string> used_;    // by visitors
  std::set<std::string> leased_;  // to background jobs
  const SceneResidency::UseOf use_of_ = [this](const std::string& id) {
    if (used_.contains(id)) return SceneUse::visitors;
    return leased_.contains(id) ? SceneUse::background : SceneUse::none;
  };
  SceneResidency residency_;
};

TEST_F(SceneResidencyTest, LoadsOnDemandOneAtATime) {
  EXPECT_EQ(want("a", 30), Answer::awaited);
  EXPECT_EQ(want("a", 30), Answer::awaited) << "a second visitor waits for the same";
  const auto step = next();
  ASSERT_TRUE(step);
  EXPECT_EQ(step->load, "a");
  EXPECT_THAT(step->release, IsEmpty());
  EXPECT_FALSE(next()) << "it is under way";
  EXPECT_EQ(want("a", 30), Answer::awaited);
  EXPECT_FALSE(residency_.resident("a"));
  residency_.loaded("a", 31, now_);
  EXPECT_EQ(want("a", 30), Answer::resident);
  EXPECT_EQ(residency_.bytes(), 31u) << "what it really takes";
}

TEST_F(SceneResidencyTest, FewTreesAreInMemoryAtATime) {
  const SceneNeed tree(1000, true);
  const auto name = [](std::size_t i) { return "tree " + std::to_string(100 + i); };
  for (std::size_t i = 0; i <= most_scenes_in_pages; ++i) {
    ASSERT_EQ(residency_.want(name(i), tree, now_, use_of_), Answer::awaited) << i;
    const auto step = next();
    ASSERT_TRUE(step) << i;
    if (i < most_scenes_in_pages) {
      EXPECT_THAT(step->release, IsEmpty());
    } else {
      EXPECT_THAT(step->release, ElementsAre(name(0))) << "the least recently used";
    }
    residency_.loaded(name(i), tree, now_);
    now_ += 100s;
  }
  for (std::size_t i = 1; i <= most_scenes_in_pages; ++i) used_.insert(name(i));
  EXPECT_EQ(residency_.want(name(0), tree, now_, use_of_), Answer::no_room);
}

TEST_F(SceneResidencyTest, OneWaitsWhileOneIsLoadedAndOthersAreRefused) {
  want("a", 10);
  next();
  EXPECT_EQ(want("b", 10), Answer::awaited);
  EXPECT_EQ(want("c", 10), Answer::busy);
  EXPECT_FALSE(next());
  residency_.loaded("a", 10, now_);
  EXPECT_EQ(next()->load, "b");
  EXPECT_EQ(want("c", 10), Answer::awaited);
}

TEST_F(SceneResidencyTest, TheLeastRecentlyUsedGoes) {
  visit("a", 40);
  now_ += 1s;
  visit("b", 40);
  now_ += 120s;
  residency_.note_use("a", now_);
  EXPECT_EQ(want("c", 40), Answer::awaited);
  EXPECT_THAT(next()->release, ElementsAre("b"));
  EXPECT_FALSE(residency_.resident("b"));
  EXPECT_TRUE(residency_.resident("a"));
}

TEST_F(SceneResidencyTest, NoMoreGoThanHaveTo) {
  visit("a", 30);
  now_ += 1s;
  visit("b", 30);
  now_ += 1s;
  visit("c", 30);
  now_ += 120s;
  want("d", 65);
  EXPECT_THAT(next()->release, ElementsAre("a", "b"));
  EXPECT_EQ(residency_.bytes(), 30u);
}

TEST_F(SceneResidencyTest, ASceneInUseNeverGoes) {
  visit("a", 60);
  used_ = {"a"};
  now_ += 1h;
  EXPECT_EQ(want("b", 60), Answer::no_room);
  EXPECT_FALSE(next());
  visit("c", 40);
  now_ += 1h;
  EXPECT_EQ(want("b", 60), Answer::no_room) << "nor is another sent away in vain";
  EXPECT_TRUE(residency_.resident("c"));
  used_.clear();
  EXPECT_EQ(want("b", 60), Answer::awaited);
  EXPECT_THAT(next()->release, ElementsAre("a"));
}

TEST_F(SceneResidencyTest, ASceneStaysForAMinuteAndTheNextOneWaitsForThat) {
  visit("a", 60);
  now_ += 59s;
  EXPECT_EQ(want("b", 60), Answer::awaited);
  EXPECT_FALSE(next());
  EXPECT_EQ(want("a", 60), Answer::resident) << "it is still there for who comes back";
  now_ += 1s;
  const auto step = next();
  ASSERT_TRUE(step);
  EXPECT_THAT(step->release, ElementsAre("a"));
  EXPECT_EQ(step->load, "b");
}

TEST_F(SceneResidencyTest, AWaitingVisitorIsRefusedWhenTheRoomIsTakenAgain) {
  visit("a", 60);
  EXPECT_EQ(want("b", 60), Answer::awaited);
  used_ = {"a"};
  now_ += 60s;
  EXPECT_FALSE(next());
  EXPECT_EQ(want("b", 60), Answer::no_room);
  EXPECT_EQ(want("c", 10), Answer::awaited) << "it blocks nobody";
}

TEST_F(SceneResidencyTest, RefusesWhatNeverFits) {
  EXPECT_EQ(want("a", 101), Answer::too_large);
  EXPECT_EQ(want("a", 100), Answer::awaited);
  residency_.pin("p", 20);
  EXPECT_EQ(want("b", 81), Answer::too_large) << "pinned scenes never go";
  SceneResidency unbounded({});
  EXPECT_EQ(unbounded.want("a", 1ull << 50, now_, use_of_), Answer::awaited);
}

TEST_F(SceneResidencyTest, PinnedScenesStay) {
  residency_.pin("p", 50);
  EXPECT_EQ(want("p", 50), Answer::resident);
  now_ += 1h;
  visit("a", 50);
  now_ += 1h;
  EXPECT_EQ(want("b", 50), Answer::awaited);
  EXPECT_THAT(next()->release, ElementsAre("a"));
}

TEST_F(SceneResidencyTest, AFailureLeavesRoomForTheNext) {
  want("a", 100);
  next();
  want("b", 50);
  residency_.failed("a");
  EXPECT_FALSE(residency_.resident("a"));
  EXPECT_EQ(next()->load, "b");
  residency_.loaded("b", 50, now_);
  EXPECT_EQ(want("a", 50), Answer::awaited) << "it may be tried again";
}

TEST_F(SceneResidencyTest, BackgroundJobLetsGoOfASceneForAVisitor) {
  visit("a", 60);
  leased_ = {"a"};
  EXPECT_EQ(want("b", 60), Answer::awaited);
  EXPECT_FALSE(next()) << "a scene stays for a minute";
  now_ += 60s;
  const auto step = next();
  ASSERT_TRUE(step);
  EXPECT_THAT(step->recall, ElementsAre("a"));
  EXPECT_EQ(step->load, "");
  EXPECT_TRUE(residency_.resident("a")) << "its memory is not free yet";
  leased_.clear();
  const auto later = next();
  ASSERT_TRUE(later);
  EXPECT_THAT(later->release, ElementsAre("a"));
  EXPECT_EQ(later->load, "b");
}

TEST_F(SceneResidencyTest, UnusedSceneGoesBeforeOneOfABackgroundJob) {
  visit("a", 50);
  now_ += 1s;
  visit("b", 50);
  leased_ = {"a"};
  now_ += 60s;
  residency_.note_use("a", now_);
  EXPECT_EQ(want("c", 50), Answer::awaited);
  EXPECT_THAT(next()->release, ElementsAre("b"));
}

TEST_F(SceneResidencyTest, BackgroundJobGetsRoomThatNobodyHasUsedForAMinute) {
  const auto for_job = [&] { return residency_.next_in_background("f", 60, now_, use_of_); };
  visit("a", 60);
  EXPECT_FALSE(for_job());
  now_ += 59s;
  residency_.note_use("a", now_);
  now_ += 59s;
  EXPECT_FALSE(for_job()) << "a visitor may come back";
  now_ += 1s;
  for (auto* const set : {&used_, &leased_}) {
    *set = {"a"};
    EXPECT_FALSE(for_job());
    set->clear();
  }
  EXPECT_EQ(want("b", 60), Answer::awaited);
  EXPECT_FALSE(for_job()) << "a visitor waits";
  residency_.failed(next()->load);
  const auto step = for_job();
  ASSERT_TRUE(step);
  EXPECT_EQ(step->load, "f");
}

TEST_F(SceneResidencyTest, LoadOfABackgroundJobRefusesNobody) {
  ASSERT_TRUE(residency_.next_in_background("f", 60, now_, use_of_));
  EXPECT_TRUE(residency_.loads_in_background());
  for (const char* id : {"a", "b", "c"}) EXPECT_EQ(want(id, 60), Answer::awaited) << id;
  residency_.failed("f");
  EXPECT_EQ(next()->load, "a");
  EXPECT_EQ(want("b", 30), Answer::awaited);
  EXPECT_EQ(want("c", 30), Answer::busy) << "a visitor's load is under way";
}

TEST_F(SceneResidencyTest, SceneOfABackgroundJobGoesAtOnceForAVisitor) {
  ASSERT_TRUE(residency_.next_in_background("f", 60, now_, use_of_));
  residency_.loaded("f", 60, now_);
  EXPECT_EQ(want("a", 60), Answer::awaited);
  EXPECT_THAT(next()->release, ElementsAre("f"));
}

class SharedPoolTest : public SceneResidencyTest {
 protected:
  SharedPoolTest() : SceneResidencyTest(50) {}
  static SceneNeed pages() { return {1'000'000, true}; }
  void visit_tree(const std::string& id) {
    ASSERT_EQ(residency_.want(id, pages(), now_, use_of_), Answer::awaited) << id;
    const auto step = next();
    ASSERT_TRUE(step && step->load == id) << id;
    residency_.loaded(id, pages(), now_);
    now_ += 120s;
  }
};

TEST_F(SharedPoolTest, TheFirstTreeTakesThePoolAndTheOthersNothing) {
  visit_tree("city");
  EXPECT_EQ(residency_.bytes(), 50u);
  visit_tree("hall");
  EXPECT_EQ(residency_.bytes(), 50u);
  EXPECT_EQ(want("whole", 50), Answer::awaited);
  EXPECT_THAT(next()->release, IsEmpty());
}

TEST_F(SharedPoolTest, AllTreesGoForAWholeSceneThatNeedsThePool) {
  visit_tree("city");
  visit_tree("hall");
  EXPECT_EQ(want("whole", 60), Answer::awaited);
  EXPECT_THAT(next()->release, ElementsAre("city", "hall"));
  residency_.loaded("whole", 60, now_);
  EXPECT_EQ(residency_.bytes(), 60u);
}

TEST_F(SharedPoolTest, TreesStayWhereTheirPoolDoes) {
  visit_tree("city");
  visit_tree("hall");
  visit("whole", 40);
  now_ += 120s;
  used_ = {"hall"};
  EXPECT_EQ(want("other", 30), Answer::awaited);
  EXPECT_THAT(next()->release, ElementsAre("whole"));
}

TEST_F(SharedPoolTest, AWholeSceneGoesForThePool) {
  visit("whole", 60);
  now_ += 120s;
  EXPECT_FALSE(residency_.has_room(pages()));
  EXPECT_EQ(residency_.want("city", pages(), now_, use_of_), Answer::awaited);
  EXPECT_THAT(next()->release, ElementsAre("whole"));
}

TEST_F(SharedPoolTest, WholeScenesInUseKeepTheTreesOut) {
  visit("whole", 60);
  used_ = {"whole"};
  EXPECT_EQ(residency_.want("city", pages(), now_, use_of_), Answer::no_room);
}

}  // namespace
}  // namespace catgs::test
