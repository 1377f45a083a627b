#pragma once

// Scenes of a folder as time passes: loads end when the test lets them, and a minute takes no time.

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/files/save_scene.h"
#include "server/base/metrics.h"
#include "server/base/scene_id.h"
#include "server/scenes/scene_library.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {

using namespace std::chrono_literals;

using Entry = std::shared_ptr<const SceneEntry>;

/// The demo city in memory, and three scenes in a folder, of which two fit beside it.
class SceneLibraryTime : public FolderTest {
 protected:
  void SetUp() override {
    // 236 bytes each as decoded: 1.2 MB.
    for (const char* name : {"a.ply", "b.ply", "c.ply"})
      save_scene(random_cloud(5000, 3), folder_ / name);
    config_.scenes = {"synth:city:1000"};
    config_.scene_folders = {folder_.path()};
    config_.scene_memory_mb = 3;
    start();
  }
  void start() {
    library_ = std::make_unique<SceneLibrary>(
        config_, RendererOptions{RendererKind::cpu, std::make_shared<ThreadPool>(2)}, background_,
        io_, metrics_, [this] { return now_; });
  }

  /// What the loader is through with comes to be known.
  void run_until(const std::function<bool()>& holds) {
    for (int i = 0; i < 20'000 && !holds(); ++i) {
      io_.restart();
      io_.poll();
      std::this_thread::sleep_for(1ms);
    }
    ASSERT_TRUE(holds());
  }
  std::string id(const std::string& name) const { return library_->resolve(name); }
  bool has(const std::string& name) const { return library_->has(id(name)); }
  std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const std::string& id : library_->scene_ids()) names.emplace_back(name_in(id));
    return names;
  }
  bool in_memory(const std::string& name) const { return library_->in_memory(id(name)) != nullptr; }
  bool awaited(const std::string& name) {
    return std::holds_alternative<SceneAwaited>(library_->want(id(name), now_));
  }
  ErrorMessage refusal(const std::string& name) {
    const auto answer = library_->want(id(name), now_);
    const auto* error = std::get_if<ErrorMessage>(&answer);
    return error ? *error : ErrorMessage{};
  }
  Entry load(const std::string& name) {
    EXPECT_TRUE(awaited(name));
    library_->on_tick(now_);
    run_until([&] { return in_memory(name); });
    return library_->in_memory(id(name));
  }
  /// So much later.
  void tick(std::chrono::seconds later) { library_->on_tick(now_ += later); }

  Background background_;
  boost::asio::io_context io_;
  Metrics metrics_;
  ServerConfig config_;
  std::unique_ptr<SceneLibrary> library_;
  TimePoint now_ = TimePoint{} + 1h;  // passes by tick() alone
};

}  // namespace catgs::test
