#pragma once

// A library that builds trees of its scenes.

#include "tests/server/scenes/scene_library_fixture.h"

namespace catgs::test {

namespace fs = std::filesystem;

class SceneTreesTest : public LibraryTest {
 protected:
  void SetUp() override {
    fs::create_directory(folder_ / "scenes");
    save_scene(random_cloud(3000, 0), folder_ / "scenes/a.ply");
    config_.scenes = {"synth:city:1000"};
    config_.scene_folders = {folder_ / "scenes"};
    config_.cache_dir = folder_ / "trees";
    config_.gaussians_of_a_tree = 1000;
  }
  /// Loads the scene, and waits until it is drawn from its tree. Nobody looks at it any more.
  void build(const std::string& name) {
    visit(name);
    run_until([&] { return entry(name)->in_pages; });
  }
  std::string state(const std::string& name) const { return listed(name).state; }
  std::vector<fs::path> trees() const { return kept(".tree"); }
  std::vector<fs::path> kept(const std::string& extension) const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder_ / "trees"))
      if (entry.path().extension() == extension) files.push_back(entry.path());
    return files;
  }
  static std::string bytes_in(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  double built() const { return metrics_.trees_built.Value(); }
  double failed() const { return metrics_.tree_builds_failed.Value(); }
};

}  // namespace catgs::test
