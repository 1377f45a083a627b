// Saves that wait for their turn. The test runs the session thread's handlers one by one.

#include "server/scenes/sidecar_saver.h"

#include <fmt/format.h>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/files/save_scene.h"
#include "server/base/metrics.h"
#include "server/base/replace_file.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

using Saved = std::future<HttpResponse>;

bool is_ready(const Saved& answer) { return answer.wait_for(0s) == std::future_status::ready; }

std::string sidecar_at(int z) {
  return fmt::format(R"({{"start_pose": {{"position": [0, 0, {}], "look_at": [0, 0, 99]}}}})", z);
}

class SidecarSaverTest : public FolderTest {
 protected:
  void SetUp() override {
    save_scene(random_cloud(500, 3), folder_ / "hall.ply");
    ServerConfig config;
    config.scenes = {(folder_ / "hall.ply").string(), "synth:city:1000"};
    library_ = std::make_unique<SceneLibrary>(
        config, RendererOptions{RendererKind::cpu, std::make_shared<ThreadPool>(2)}, background_,
        io_, metrics_);
    saver_ = std::make_unique<SidecarSaver>(*library_, background_, io_);
    hall_ = library_->resolve("hall");
    scene_ = entry();
    posters_.insert(scene_->poster);
  }
  void TearDown() override { saver_.reset(); }
  std::shared_ptr<const SceneEntry> entry() const {
    return std::get<std::shared_ptr<const SceneEntry>>(library_->want(hall_, Clock::now()));
  }

  /// The scene stays as it is until run_until() runs the session thread's handlers.
  Saved save(const std::string& json, const std::string& if_match = "") {
    return saver_->save(hall_, json, {if_match, ""}, place_);
  }
  /// Notes each poster that visitors get meanwhile.
  void run_until(const std::function<bool()>& holds) {
    for (int i = 0; i < 20'000 && !holds(); ++i) {
      io_.restart();
      while (io_.poll_one() > 0) posters_.insert(entry()->poster);
      std::this_thread::sleep_for(1ms);
    }
    ASSERT_TRUE(holds());
  }
  /// Until the posters of the saves so far are done, if they need any.
  void run_all() {
    std::promise<void> done;
    auto last = done.get_future();
    Background::Jobs jobs(background_);
    jobs.start(lanes.sidecars, Priority::low, [&](const auto&) { done.set_value(); });
    run_until([&] { return last.wait_for(0s) == std::future_status::ready; });
  }
  [[nodiscard]] std::string on_disk() const {
    return sidecar_text(folder_ / "hall.json").value_or("");
  }

  Background background_;
  boost::asio::io_context io_;
  Metrics metrics_;
  std::unique_ptr<SceneLibrary> library_;
  std::unique_ptr<SidecarSaver> saver_;
  std::string hall_;                                      // the scene's id
  std::shared_ptr<const SceneEntry> scene_;               // before any save
  std::set<std::shared_ptr<const std::string>> posters_;  // that visitors got
  std::shared_ptr<UploadSlot> place_ = std::make_shared<UploadSlot>();
};

TEST_F(SidecarSaverTest, AnAbandonedUploadIsNotSaved) {
  const auto place = std::make_shared<UploadSlot>();
  const std::weak_ptr<const UploadSlot> held = place;
  Saved gone = saver_->save(hall_, sidecar_at(1), {}, place);
  Saved stays = save(sidecar_at(2), "*");
  place->abandon();
  run_until([&] { return is_ready(stays); });
  EXPECT_EQ(stays.get().status, 412) << "there is nothing that it could replace";
  EXPECT_EQ(on_disk(), "");
  EXPECT_EQ(held.use_count(), 1) << "the saver keeps nothing of it";
}

TEST_F(SidecarSaverTest, ARefusalChangesNothingAndRendersNothing) {
  Saved stale = save(sidecar_at(1), "\"another\"");
  Saved wrong = save("{\"start_pose\": 1}");
  run_until([&] { return is_ready(stale) && is_ready(wrong); });
  EXPECT_EQ(stale.get().status, 412);
  EXPECT_EQ(wrong.get().status, 400);
  run_all();
  EXPECT_EQ(entry(), scene_);
}

TEST_F(SidecarSaverTest, ABrokenFileIsNotReplacedUnseen) {
  folder_.write("hall.json", "{broken");
  Saved stale = save(sidecar_at(1), "\"another\"");
  run_until([&] { return is_ready(stale); });
  EXPECT_EQ(stale.get().status, 412);
  EXPECT_EQ(on_disk(), "{broken");
  EXPECT_EQ(entry(), scene_);
}

TEST_F(SidecarSaverTest, SavesThatWaitTogetherGetOnePoster) {
  std::vector<Saved> saves;
  for (const int z : {1, 2, 3}) saves.push_back(save(sidecar_at(z)));
  run_until([&] { return is_ready(saves.back()); });
  for (Saved& answer : saves) EXPECT_EQ(answer.get().status, 200);
  EXPECT_EQ(on_disk(), sidecar_at(3));
  EXPECT_FLOAT_EQ(entry()->facts.start_pose.position.z, 3.0f);
  run_until([&] { return entry()->poster != scene_->poster; });
  run_all();
  EXPECT_EQ(posters_.size(), 2u) << "the one before, and one";
}

TEST_F(SidecarSaverTest, APosterThatFoundNoRoomComesWithTheNextSave) {
  Background::Jobs others(background_);
  const auto add = [&] { return others.start(lanes.sidecars, Priority::normal, [](auto&) {}); };
  std::promise<void> begun, go_on;
  others.start(lanes.sidecars, Priority::normal, [&](const auto&) {
    begun.set_value();
    go_on.get_future().wait();
  });
  begun.get_future().wait();
  Saved first = save(sidecar_at(1));
  while (add() != 0) {
  }
  go_on.set_value();
  while (add() == 0) std::this_thread::sleep_for(1ms);  // the save has begun, and left a place
  run_until([&] { return is_ready(first); });
  others.end();
  run_all();
  EXPECT_EQ(entry()->poster, scene_->poster);
  const Saved second = save(sidecar_at(2));
  run_until([&] { return entry()->poster != scene_->poster; });
}

TEST_F(SidecarSaverTest, ToursAloneNeedNoPoster) {
  Saved tours = save(R"({"tours": [{"title": "Hall", "stops": []}]})");
  run_until([&] { return is_ready(tours); });
  EXPECT_EQ(tours.get().status, 200);
  run_all();
  EXPECT_THAT(*entry()->tours.for_viewers, HasSubstr("Hall"));
  EXPECT_EQ(posters_.size(), 1u);
}

TEST_F(SidecarSaverTest, SavedTextsAreShownAtOnce) {
  Saved said = save(R"({"title": "The hall", "credits": "Ada", "background": "#ffffff"})");
  run_until([&] { return entry()->poster != scene_->poster; });
  EXPECT_EQ(said.get().status, 200);
  const auto shown = [&] { return library_->listing()->front(); };
  EXPECT_EQ(shown().title, "The hall");
  EXPECT_EQ(shown().about.credits, "Ada");
  EXPECT_EQ(entry()->facts.about.background_rgb, 0xffffffu);
  Saved nothing = save("{}");
  run_until([&] { return is_ready(nothing); });
  EXPECT_EQ(shown().title, "hall") << "its name again";
}

TEST_F(SidecarSaverTest, SavedPlacesAreThoseOfTheFile) {
  const auto far = std::make_shared<SceneEntry>(*scene_);
  far->facts.origin = {500123.0, 5412345.0, 431.0};
  library_->revise(hall_, far);
  const std::string sent =
      R"({"start_pose": {"position": [500123.5, 5412345, 427], "orientation": [0, 0, 0, 1]},
          "focus": [500123.25, 5412345, 431]})";
  Saved saved = save(sent);
  run_until([&] { return is_ready(saved); });
  EXPECT_EQ(saved.get().status, 200);
  const SceneFacts facts = entry()->facts;
  EXPECT_EQ(facts.start_pose.position, glm::vec3(0.5f, 0.0f, -4.0f));
  EXPECT_EQ(facts.focus, glm::vec3(0.25f, 0.0f, 0.0f));
  EXPECT_EQ(facts.origin, far->facts.origin);
  EXPECT_EQ(on_disk(), sent);
  run_all();
}

TEST_F(SidecarSaverTest, StoppingFinishesTheBegunSaveAndAnswersTheOthers) {
  Saved begun = save(sidecar_at(1));
  Saved waits = save(sidecar_at(2));
  while (io_.poll_one() == 0) {  // until the first save has its scene
    io_.restart();
    std::this_thread::yield();
  }
  saver_->stop();
  ASSERT_TRUE(is_ready(waits));
  const HttpResponse refused = waits.get();
  EXPECT_EQ(refused.status, 503);
  EXPECT_GT(refused.retry_after_s, 0);
  Saved later = save(sidecar_at(3));
  run_until([&] { return is_ready(begun) && is_ready(later); });
  EXPECT_EQ(begun.get().status, 200);
  EXPECT_EQ(later.get().status, 503);
  EXPECT_EQ(on_disk(), sidecar_at(1)) << "what was told to be saved is there";
  io_.restart();
  EXPECT_EQ(io_.poll(), 0u) << "nothing goes on, no poster either";
}

TEST_F(SidecarSaverTest, ASaveWaitsForNoServerThatHoldsTheFolder) {
  const FileLock held = lock_for_saving(folder_.path());
  Saved busy = save(sidecar_at(1));
  run_until([&] { return is_ready(busy); });
  const HttpResponse answer = busy.get();
  EXPECT_EQ(answer.status, 503);
  EXPECT_GT(answer.retry_after_s, 0);
  EXPECT_EQ(on_disk(), "");
}

TEST_F(SidecarSaverTest, FilesThatKilledServersLeftAreRemoved) {
  const auto left = [&](const std::string& name) {
    const auto file = folder_.write(name, "half");
    std::filesystem::last_write_time(
        file, std::filesystem::file_time_type::clock::now() - surely_stale - 1h);
    return file;
  };
  const auto sidecar = left(".hall.json.3f0c91d29b1deb4d.new");
  const auto medium = left("hall.media/.door.jpg.3f0c91d29b1deb4d.new");
  const auto other = left("hall.media/door.jpg");
  saver_->remove_stale_files_in({folder_.path()});
  run_until([&] { return !std::filesystem::exists(sidecar) && !std::filesystem::exists(medium); });
  EXPECT_TRUE(std::filesystem::exists(other));
}

}  // namespace
}  // namespace catgs::test
