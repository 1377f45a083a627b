// Jobs whose scene goes and comes back. The test is the session thread.

#include "server/films/film_renderer.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/thread_pool.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

const std::string view = "[0, 0, -6, 0, 0, 0, 1, 60]";

std::string film_of(int frames) {
  return fmt::format(R"({{"kind": "film", "size": [64, 48], "views": [{}, {}]}})", view,
                     frames - 1);
}

class FilmRendererTest : public testing::Test {
 protected:
  FilmRendererTest() {
    scene.renderer =
        make_renderer(std::make_shared<GaussianCloud>(random_cloud(300, 0)),
                      {.kind = RendererKind::cpu, .pool = std::make_shared<ThreadPool>(1)})
            .renderer;
    scene.facts.near_z = 0.2f;
  }
  void start(std::chrono::milliseconds longest_wait = 10min) {
    films.emplace(FilmRenderer::Surroundings{
        io, background,
        [this](const std::string&, bool again) {
          asked_again = asked_again || again;
          return there ? leased(scene, leases, content) : LeasedScene{.gone = gone};
        },
        [] { return false; }, [this](std::string_view owner) { return owner == revoked.load(); },
        longest_wait});
  }
  std::string order(const std::string& json, const std::string& owner = "ada") {
    auto answer = films->order("hall", owner, json, std::make_shared<UploadSlot>());
    return nlohmann::json::parse(*answer.get().body).at("id");
  }
  nlohmann::json report(const std::string& job) {
    return nlohmann::json::parse(*films->report(job).body);
  }
  void run_until(const std::function<bool()>& holds) {
    for (int i = 0; i < 20'000 && !holds(); ++i) {
      io.restart();
      io.poll();
      std::this_thread::sleep_for(1ms);
    }
    ASSERT_TRUE(holds());
  }
  /// A film without end, of which some frames are drawn.
  std::string begin() {
    const std::string job = order(film_of(18'000));
    run_until([&] { return report(job).at("share") > 0.0; });
    return job;
  }
  /// As for a visitor of another scene.
  void take_the_memory() {
    there = false;
    ++leases->recalls;
    run_until([&] { return leases->held == 0; });
  }
  std::string error_of(const std::string& job) {
    run_until([&] { return report(job).at("state") == "failed"; });
    return report(job).at("error");
  }

  SceneEntry scene;
  const std::shared_ptr<SceneLeases> leases = std::make_shared<SceneLeases>();
  bool there = true, gone = false, asked_again = false;
  int content = 0;
  std::atomic<const char*> revoked{""};
  Background background;
  boost::asio::io_context io;
  std::optional<FilmRenderer> films;
};

TEST_F(FilmRendererTest, JobLetsGoOfItsSceneAndTakesItAgain) {
  start();
  const std::string job = order(film_of(4000));
  run_until([&] { return report(job).at("share") > 0.0; });
  asked_again = false;
  take_the_memory();
  EXPECT_EQ(scene.renderer.use_count(), 1) << "no View of it is left";
  run_until([&] { return asked_again; });
  EXPECT_EQ(report(job).at("state"), "drawing");
  there = true;
  run_until([&] { return report(job).at("state") == "done"; });
  EXPECT_EQ(films->result(job).content_type, "video/mp4");
  EXPECT_EQ(leases->held, 0);
}

TEST_F(FilmRendererTest, JobEndsWithTheReasonWhyItsSceneStaysAway) {
  start(1ms);
  std::string job = begin();
  take_the_memory();
  EXPECT_THAT(error_of(job), HasSubstr("visitors of other scenes need the memory"));
  there = true;
  job = begin();
  gone = true;
  take_the_memory();
  EXPECT_THAT(error_of(job), HasSubstr("not offered any more"));
}

TEST_F(FilmRendererTest, JobShowsOneContentOfItsScene) {
  start();
  const std::string job = begin();
  take_the_memory();
  ++content;
  there = true;
  EXPECT_THAT(error_of(job), HasSubstr("file has changed"));
}

TEST_F(FilmRendererTest, JobThatWaitsForItsSceneCanBeCancelled) {
  start();
  const std::string job = begin();
  take_the_memory();
  EXPECT_EQ(films->cancel(job).status, 200);
  there = true;
  const std::string next = order(film_of(2));
  run_until([&] { return report(next).at("state") == "done"; });
}

TEST_F(FilmRendererTest, JobThatWaitedForOthersWaitsForItsScene) {
  start();
  const std::string first = begin();
  const std::string job = order(film_of(2), "bob");
  io.restart();
  io.poll();
  take_the_memory();
  EXPECT_EQ(films->cancel(first).status, 200);
  run_until([&] { return report(job).at("state") != "waiting"; });
  asked_again = false;
  run_until([&] { return asked_again || report(job).at("state") == "failed"; });
  there = true;
  run_until([&] { return report(job).at("state") != "drawing"; });
  EXPECT_EQ(report(job).at("state"), "done") << report(job);
}

TEST_F(FilmRendererTest, RevokedLinkHasNoResultAndNoJob) {
  start();
  const std::string done = order(film_of(2));
  run_until([&] { return report(done).at("state") == "done"; });
  EXPECT_EQ(films->result(done).status, 200);
  const std::string drawn = begin();
  revoked = "ada";
  EXPECT_EQ(films->report(done).status, 404);
  EXPECT_EQ(films->result(done).status, 404);
  EXPECT_TRUE(films->refuse_cancel(drawn));
  run_until([&] { return leases->held == 0; });
  revoked = "";
  EXPECT_EQ(report(drawn).at("state"), "cancelled");
}

}  // namespace
}  // namespace catgs::test
