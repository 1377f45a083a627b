// Background jobs hold scenes of a real library, and visitors come first.

#include "server/scenes/scene_lease.h"

#include "tests/server/scenes/scene_library_fixture.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

class SceneLeaseTest : public SceneLibraryTime {
 protected:
  LeasedScene lease(const std::string& name, bool again = false) {
    return library_->lease(id(name), again);
  }
  /// "b" and "c" are in memory, used in this order and long ago; "a" had to leave.
  void let_a_leave() {
    load("a");
    load("b");
    tick(60s);
    library_->want(id("b"), now_);
    tick(1s);
    load("c");
    ASSERT_FALSE(in_memory("a"));
    tick(60s);
  }
};

TEST_F(SceneLeaseTest, BackgroundJobShutsNobodyOut) {
  load("a");
  const Entry seen = load("b");
  LeasedScene film = lease("a");
  ASSERT_TRUE(film.lease);
  tick(3600s);
  EXPECT_FALSE(film.lease->recalled()) << "nobody needs the memory";
  EXPECT_TRUE(awaited("c"));
  EXPECT_TRUE(film.lease->recalled());
  tick(1s);
  EXPECT_TRUE(in_memory("a")) << "the job is within a picture";
  film = {};
  EXPECT_FALSE(lease("a").lease) << "a visitor waits for the room";
  tick(1s);
  EXPECT_FALSE(in_memory("a"));
  run_until([&] { return in_memory("c"); });
}

TEST_F(SceneLeaseTest, BackgroundJobKeepsASceneThatVisitorsKeep) {
  const Entry seen = load("a"), also_seen = load("b");
  const LeasedScene film = lease("a");
  tick(3600s);
  EXPECT_THAT(refusal("c").message, HasSubstr("no memory for"));
  EXPECT_FALSE(film.lease->recalled());
  EXPECT_TRUE(lease("a").lease);
}

TEST_F(SceneLeaseTest, BackgroundJobGetsItsSceneAgain) {
  let_a_leave();
  EXPECT_FALSE(lease("a").lease);
  library_->want(id("b"), now_);
  library_->want(id("c"), now_);
  tick(5s);
  lease("a", true);
  EXPECT_TRUE(in_memory("b") && in_memory("c")) << "somebody has just looked at them";
  tick(6s);
  run_until([&] { return lease("a", true).lease != nullptr; });
  EXPECT_TRUE(lease("nowhere", true).gone);
}

TEST_F(SceneLeaseTest, LoadForABackgroundJobGivesWay) {
  let_a_leave();
  std::promise<void> mount;
  hang_when_released("b", mount);
  tick(1s);
  library_->want(id("c"), now_);
  tick(60s);
  EXPECT_FALSE(lease("a", true).lease);
  EXPECT_FALSE(in_memory("b")) << "it leaves for the job";
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(awaited("b")) << "a visitor asks again";
  mount.set_value();
  run_until([&] {
    library_->on_tick(now_);
    return in_memory("b");
  });
  EXPECT_FALSE(in_memory("a"));
  EXPECT_TRUE(in_memory("c")) << "no other had to leave";
  EXPECT_EQ(metrics_.scene_loads_failed.Value(), 0);
}

TEST_F(SceneLeaseTest, PosterGivesWayAndIsMadeLater) {
  load("b");
  std::promise<void> mount;
  hang_when_released("b", mount);
  std::filesystem::remove(folder_ / "b.ply");
  rescan(3);
  tick(1s);  // the loader is busy from now on
  const auto has_poster = [&] { return listed("a").poster != nullptr; };
  library_->want_poster(id("a"));
  io_->restart();
  io_->poll();
  EXPECT_TRUE(awaited("c"));
  mount.set_value();
  run_until([&] { return in_memory("c"); });
  EXPECT_FALSE(has_poster());
  run_until([&] {
    library_->want_poster(id("a"));
    return has_poster();
  });
}

TEST_F(SceneLeaseTest, BackgroundJobHearsThatTheFileHasChanged) {
  load("a");
  LeasedScene film = lease("a");
  const int before = film.lease->content();
  replace("a.ply", 100);
  tick(31s);
  run_until([&] { return library_->listing()->at(1).gaussians == 100; });
  tick(1s);
  EXPECT_TRUE(film.lease->recalled()) << "nobody else looks at the old one";
  film = {};
  tick(1s);
  EXPECT_FALSE(in_memory("a"));
  run_until([&] {
    film = lease("a", true);
    return film.lease != nullptr;
  });
  EXPECT_NE(film.lease->content(), before);
  EXPECT_EQ(film.entry->facts.gaussians, 100u);
}

TEST_F(SceneLeaseTest, SavedSceneKeepsNoLease) {
  load("a");
  load("b");
  {
    const LeasedScene saver = lease("a");
    auto revised = std::make_shared<SceneEntry>(*saver.entry);
    revised->facts.title = "Saved";
    library_->revise(id("a"), std::move(revised));
  }
  EXPECT_EQ(entry("a")->facts.title, "Saved");
  tick(60s);
  library_->want(id("b"), now_);
  EXPECT_TRUE(awaited("c"));
  tick(1s);
  EXPECT_FALSE(in_memory("a"));
}

}  // namespace
}  // namespace catgs::test
