#pragma once

// Scenes of a folder as time passes: loads end when the test lets them, and a minute takes no time.

#include "render_core/base/thread_pool.h"
#include "render_core/scene/files/save_scene.h"
#include "server/base/background.h"
#include "server/base/metrics.h"
#include "server/base/scene_id.h"
#include "server/scenes/scene_library.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/test.h"

namespace catgs::test {

using Entry = std::shared_ptr<const SceneEntry>;

/// A library whose clock and whose handlers the test runs.
class LibraryTest : public FolderTest {
 protected:
  void start() {
    library_.reset();  // which takes the cache with it
    io_.emplace();     // and what the library has asked of it
    library_ = std::make_unique<SceneLibrary>(
        config_, RendererOptions{RendererKind::cpu, std::make_shared<ThreadPool>(2)}, background_,
        *io_, metrics_, [this] { return now_; });
  }
  /// Runs the handlers of finished loads until it holds. With `ticks_` the library ticks meanwhile.
  void run_until(const std::function<bool()>& holds) {
    for (int i = 0; i < 120'000 && !holds(); ++i) {
      io_->restart();
      io_->poll();
      if (ticks_) library_->on_tick(now_);
      std::this_thread::sleep_for(1ms);
    }
    ASSERT_TRUE(holds());
  }
  std::string id(const std::string& name) const { return library_->resolve(name); }
  bool in_memory(const std::string& name) const {
    const auto listing = library_->listing();
    return std::ranges::any_of(
        *listing, [&](const auto& scene) { return scene.id == id(name) && scene.loaded; });
  }
  Entry entry(const std::string& name) const {
    return in_memory(name) ? std::get<Entry>(library_->want(id(name), now_)) : nullptr;
  }
  /// As a visitor does, who asks with each tick.
  Entry visit(const std::string& name) {
    run_until([&] { return std::holds_alternative<Entry>(library_->want(id(name), now_)); });
    return std::get<Entry>(library_->want(id(name), now_));
  }
  bool awaited(const std::string& name) {
    return std::holds_alternative<SceneAwaited>(library_->want(id(name), now_));
  }
  SceneLibrary::Listing listed(const std::string& name) const {
    const auto listing = library_->listing();
    return *std::ranges::find(*listing, id(name), &SceneLibrary::Listing::id);
  }

  /// Certainly another time.
  void touch(const std::string& file) const {
    const auto before = std::filesystem::last_write_time(folder_ / file);
    std::filesystem::last_write_time(folder_ / file, before + 2s);
  }
  /// Another content of the same file, of so many Gaussians.
  void replace(const std::string& file, std::size_t gaussians) const {
    const auto before = std::filesystem::last_write_time(folder_ / file);
    save_scene(random_cloud(gaussians, 0), folder_ / file);
    std::filesystem::last_write_time(folder_ / file, before + 2s);
  }

  Background background_;
  std::optional<boost::asio::io_context> io_;
  Metrics metrics_;
  ServerConfig config_;
  std::unique_ptr<SceneLibrary> library_;
  TimePoint now_ = TimePoint{} + 1h;
  bool ticks_ = true;
};

/// The demo city in memory, and three scenes in a folder, of which two fit beside it.
class SceneLibraryTime : public LibraryTest {
 protected:
  void SetUp() override {
    // 236 bytes each as decoded: 1.2 MB.
    for (const char* name : {"a.ply", "b.ply", "c.ply"})
      save_scene(random_cloud(5000, 3), folder_ / name);
    config_.scenes = {"synth:city:1000"};
    config_.scene_folders = {folder_.path()};
    config_.scene_memory_mb = 3;
    ticks_ = false;
    start();
  }

  bool has(const std::string& name) const { return library_->has(id(name)); }
  std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const std::string& id : library_->scene_ids()) names.emplace_back(name_in(id));
    return names;
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
    return entry(name);
  }
  /// The loader frees this scene when it leaves memory, and stays in it until `mount` is set.
  void hang_when_released(const std::string& name, std::promise<void>& mount) {
    const auto free = [&mount](const SceneEntry* entry) {
      mount.get_future().wait();
      delete entry;
    };
    library_->revise(id(name), Entry(new SceneEntry(*entry(name)), free));
  }
  /// So much later.
  void tick(std::chrono::seconds later) { library_->on_tick(now_ += later); }
  /// So much later, until so many scenes are listed.
  void rescan(std::size_t scenes) {
    tick(31s);
    run_until([&] { return library_->listing()->size() == scenes; });
  }
};

}  // namespace catgs::test
