#pragma once

// A library that builds trees of its scenes.

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/files/save_scene.h"
#include "server/scenes/scene_library.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

using Entry = std::shared_ptr<const SceneEntry>;

class SceneTreesTest : public FolderTest {
 protected:
  void SetUp() override {
    fs::create_directory(folder_ / "scenes");
    save_scene(random_cloud(3000, 0), folder_ / "scenes/a.ply");
    config_.scenes = {"synth:city:1000"};
    config_.scene_folders = {folder_ / "scenes"};
    config_.cache_dir = folder_ / "trees";
    config_.gaussians_of_a_tree = 1000;
  }
  void start() {
    library_.reset();  // which takes the cache with it
    library_ = std::make_unique<SceneLibrary>(
        config_, RendererOptions{RendererKind::cpu, std::make_shared<ThreadPool>(2)}, background_,
        io_, metrics_, [this] { return now_; });
  }
  /// Lets loads and builds end, and ticks, until it holds.
  void run_until(const std::function<bool()>& holds) {
    for (int i = 0; i < 20'000 && !holds(); ++i) {
      io_.restart();
      io_.poll();
      library_->on_tick(now_);
      std::this_thread::sleep_for(1ms);
    }
    ASSERT_TRUE(holds());
  }
  std::string id(const std::string& name) const { return library_->resolve(name); }
  Entry in_memory(const std::string& name) const { return library_->in_memory(id(name)); }
  /// As a visitor does, who asks with each tick.
  Entry load(const std::string& name) {
    run_until([&] { return std::holds_alternative<Entry>(library_->want(id(name), now_)); });
    return in_memory(name);
  }
  /// Loads the scene, and waits until it is drawn from its tree. Nobody looks at it any more.
  void build(const std::string& name) {
    load(name);
    run_until([&] { return in_memory(name)->in_pages; });
  }
  std::string state(const std::string& name) const {
    const auto listing = library_->listing();
    return std::ranges::find(*listing, id(name), &SceneLibrary::Listing::id)->state;
  }
  std::vector<fs::path> trees() const {
    std::vector<fs::path> trees;
    for (const auto& entry : fs::directory_iterator(folder_ / "trees"))
      if (entry.path().filename() != "lock") trees.push_back(entry.path());
    return trees;
  }
  static std::string bytes_in(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  double built() const { return metrics_.trees_built.Value(); }
  double failed() const { return metrics_.tree_builds_failed.Value(); }

  Background background_;
  boost::asio::io_context io_;
  Metrics metrics_;
  ServerConfig config_;
  std::unique_ptr<SceneLibrary> library_;
  TimePoint now_ = TimePoint{} + 1h;
};

}  // namespace catgs::test
