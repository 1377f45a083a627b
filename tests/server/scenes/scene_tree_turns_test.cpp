// Trees are built and taken into use without keeping visitors or jobs waiting.
#include <future>

#include "tests/server/scenes/scene_trees_fixture.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

TEST_F(SceneTreesTest, TreeThatVisitorsWaitForComesFirst) {
  save_scene(random_cloud(100'000, 0), folder_ / "scenes/large.ply");  // 5.6 MB
  save_scene(random_cloud(30'000, 3), folder_ / "scenes/b.ply");       // 7.1 MB
  config_.scene_memory_mb = 6;
  start();
  std::promise<void> go;
  Background::Jobs others(background_);
  others.start(lanes.trees, Priority::high, [&](const auto&) { go.get_future().wait(); });
  visit("large");
  library_->on_tick(now_);
  EXPECT_THAT(state("large"), HasSubstr("waits")) << "it is shown as a whole meanwhile";
  EXPECT_TRUE(std::holds_alternative<SceneAwaited>(library_->want(id("b"), now_)));
  go.set_value();
  run_until([&] {
    EXPECT_FALSE(!state("b").empty() && state("large").empty());
    return built() == 2;
  });
  EXPECT_EQ(failed(), 0);
}

TEST_F(SceneTreesTest, SceneInTwoFormsKeepsNobodyOut) {
  save_scene(random_cloud(25'000, 3), folder_ / "scenes/b.ply");  // 5.9 MB, and 6.5 MB of pages
  save_scene(random_cloud(5'000, 3), folder_ / "scenes/c.ply");   // 1.2 MB
  config_.scene_memory_mb = 13;
  config_.gaussians_of_a_tree = 20'000;
  start();
  Entry seen = visit("b");
  run_until([&] { return library_->newer_representation(*seen) != nullptr; });
  EXPECT_TRUE(awaited("c")) << "the form before goes as soon as its visitor has the new one";
  seen.reset();
  EXPECT_FALSE(visit("c")->in_pages);
}

TEST_F(SceneTreesTest, BackgroundJobGoesOnWithTheTree) {
  start();
  visit("a");
  LeasedScene film = library_->lease(id("a"));
  ASSERT_TRUE(film.lease);
  EXPECT_FALSE(film.entry->in_pages);
  run_until([&] { return film.lease->recalled(); });
  const double with_both = metrics_.scene_bytes.Value();
  film = {};
  film = library_->lease(id("a"));
  EXPECT_TRUE(film.entry->in_pages);
  run_until([&] { return metrics_.scene_bytes.Value() < with_both; });
}

}  // namespace
}  // namespace catgs::test
