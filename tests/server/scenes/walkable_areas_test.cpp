// Scenes of a real library, and where people can walk in them.
#include "server/scenes/walkable_areas.h"

#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>
#include <sys/stat.h>

#include "render_core/walk/walk_file.h"
#include "tests/render_core/walk/worlds.h"
#include "tests/server/scenes/scene_library_fixture.h"
#include "tests/support/walker.h"

namespace catgs::test {
namespace {

namespace fs = std::filesystem;

using SharedArea = std::shared_ptr<const WalkableArea>;

constexpr auto sidecar =
    R"({"up": [0, 0, 1], "start_pose": {"position": [2, 2, 1.6], "look_at": [2, 5, 1.6]}, "metres_per_unit": 1})";

std::string bytes_in(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

walk::WalkMap map_in(const std::string& bytes) {
  return walk::read_walk_file(MemorySource("served", std::as_bytes(std::span(bytes))));
}

class WalkableAreasTest : public LibraryTest {
 protected:
  void SetUp() override {
    fs::create_directory(folder_ / "scenes");
    save_scene(room(0.9f), folder_ / "scenes/a.ply");
    write("scenes/a.json", sidecar);
    config_.scenes = {"synth:stress:1000"};
    config_.scene_folders = {folder_ / "scenes"};
    config_.cache_dir = folder_ / "cache";
  }
  std::string id() const { return LibraryTest::id("a"); }
  Entry load() { return visit("a"); }
  SharedArea listed() const { return LibraryTest::listed("a").walkable_area; }
  /// As a page does that asks again and again.
  SharedArea found() {
    run_until([&] {
      library_->want_walkable_area(id());
      return listed() != nullptr;
    });
    return listed();
  }
  std::vector<fs::path> kept() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder_ / "cache"))
      if (entry.path().extension() == ".walk") files.push_back(entry.path());
    return files;
  }
};

TEST_F(WalkableAreasTest, AScenesAreaIsFoundWhenAPageAsks) {
  start();
  library_->want_walkable_area(id());  // not in memory
  const Entry seen = load();
  EXPECT_EQ(listed(), nullptr);
  const SharedArea walkable_area = found();
  ASSERT_NE(walkable_area->file, nullptr);
  EXPECT_EQ(walkable_area->etag, etag_of(*walkable_area->file));
  const walk::WalkMap map = map_in(*walkable_area->file);
  EXPECT_FLOAT_EQ(map.grid.cell, 0.1f);
  EXPECT_TRUE(walk::stand_below(map, {6, 3, 2}));
  ASSERT_EQ(kept().size(), 1u);
  EXPECT_EQ(bytes_in(kept()[0]), *walkable_area->file);
}

TEST_F(WalkableAreasTest, TheNextStartReadsWhatWasFound) {
  start();
  load();
  found();
  ASSERT_EQ(kept().size(), 1u);
  const std::string other = walk::pack(map_of(stairs(), {0, 3, 1.6f}));
  std::ofstream(kept()[0], std::ios::binary) << other;
  start();
  load();
  EXPECT_EQ(*found()->file, other);
  // One that is damaged is computed again.
  std::ofstream(kept()[0], std::ios::binary) << other.substr(0, 900);
  start();
  load();
  EXPECT_TRUE(walk::stand_below(map_in(*found()->file), {6, 3, 2}));
  EXPECT_EQ(bytes_in(kept().at(0)), *listed()->file);
}

TEST_F(WalkableAreasTest, APipeInPlaceOfAFileIsReplaced) {
  start();
  load();
  found();
  const fs::path file = kept().at(0);
  for (const fs::path& name : {file, fs::path(file.string() + ".part")}) {
    fs::remove(name);
    ASSERT_EQ(::mkfifo(name.c_str(), 0600), 0);
  }
  ASSERT_EQ(::mkfifo((folder_ / "scenes/a.walk").c_str(), 0600), 0);  // in place of the author's
  start();
  load();
  const SharedArea walkable_area = found();
  ASSERT_TRUE(fs::is_regular_file(file));
  EXPECT_EQ(bytes_in(file), *walkable_area->file);
}

TEST_F(WalkableAreasTest, TheAuthorsFileComesFirst) {
  const std::string own = walk::pack(map_of(stairs(), {0, 3, 1.6f}));
  write("scenes/a.walk", own);
  start();
  load();
  EXPECT_EQ(*found()->file, own);
  EXPECT_TRUE(kept().empty());
}

TEST_F(WalkableAreasTest, ABadFileOfTheAuthorsIsNoHarm) {
  for (const std::string& bad : {std::string("no walk file"), std::string()}) {
    write("scenes/a.walk", bad);
    start();
    load();
    EXPECT_TRUE(walk::stand_below(map_in(*found()->file), {6, 3, 2}));
  }
}

TEST_F(WalkableAreasTest, ASceneWithoutAnAreaIsSearchedOnce) {
  save_scene(random_cloud(300, 0), folder_ / "scenes/a.ply");
  start();
  load();
  EXPECT_EQ(found()->file, nullptr);
  ASSERT_EQ(kept().size(), 1u);
  EXPECT_EQ(fs::file_size(kept()[0]), 0u);
  start();
  load();
  EXPECT_EQ(found()->file, nullptr);
}

TEST_F(WalkableAreasTest, StaysWithItsSceneWhenThereIsNoFolder) {
  config_.cache_dir.clear();
  start();
  load();
  EXPECT_NE(found()->file, nullptr);
}

TEST_F(WalkableAreasTest, AnotherStartHasAnotherArea) {
  start();
  const Entry seen = load();
  const SharedArea before = found();
  auto turned = std::make_shared<SceneEntry>(*seen);
  turned->facts.about.title = "Another title";
  library_->revise(id(), turned);
  EXPECT_EQ(listed(), before) << "the walkable area stays where a title changes";
  turned = std::make_shared<SceneEntry>(*turned);
  turned->facts.about.metres_per_unit = 2.0f;
  library_->revise(id(), turned);
  EXPECT_EQ(listed(), nullptr);
  EXPECT_FLOAT_EQ(map_in(*found()->file).grid.cell, 0.05f);
  EXPECT_EQ(kept().size(), 2u);
}

TEST_F(WalkableAreasTest, AChangedSceneGetsItsOwnArea) {
  start();
  Entry seen = load();
  found();
  save_scene(room(1.2f), folder_ / "scenes/a.ply");
  now_ += 31s;
  run_until([&] { return listed() && !listed()->file; });
  seen.reset();  // the last visitor of the old one leaves
  run_until([&] { return !in_memory("a"); });
  EXPECT_EQ(listed(), nullptr);
  load();
  EXPECT_NE(found()->file, nullptr);
  EXPECT_EQ(kept().size(), 2u);
}

TEST_F(WalkableAreasTest, ATreeIsReadPartByPart) {
  config_.gaussians_of_a_tree = 1000;
  start();
  load();
  run_until([&] { return entry("a")->in_pages; });
  const SharedArea walkable_area = found();
  ASSERT_NE(walkable_area->file, nullptr);
  EXPECT_TRUE(walk::stand_below(map_in(*walkable_area->file), {6, 3, 2}));
}

TEST_F(WalkableAreasTest, AFailureThatPassesIsNoAnswer) {
  start();
  const Entry seen = load();
  fs::rename(folder_ / "scenes/a.ply", folder_ / "scenes/a.away");
  const auto ask = [&] { library_->want_walkable_area(id()); };
  for (int i = 0; i < 300; ++i) {
    ask();
    io_->restart();
    io_->run_for(1ms);
  }
  EXPECT_EQ(listed(), nullptr);
  fs::rename(folder_ / "scenes/a.away", folder_ / "scenes/a.ply");
  run_until([&] {
    now_ += 1s;  // the library may have looked while the file was away, and looks again
    return std::holds_alternative<Entry>(library_->want(id(), now_));
  });
  run_until([&] {
    ask();
    now_ += 1min;  // the failure may only be known now
    return listed() != nullptr;
  });
  EXPECT_NE(listed()->file, nullptr);
}

TEST_F(WalkableAreasTest, TheLibraryEndsDuringASearch) {
  start();
  load();
  library_->want_walkable_area(id());
  io_->poll();
  library_.reset();
}

/// Its header tells how large it is.
TEST(ComputedWalkableArea, NeedsTheCacheForManyGaussians) {
  const TemporaryFolder folder;
  const auto error = [&](int gaussians) {
    WalkableAreaSource source;
    source.scene =
        locate_scene(folder.write("a.ply", fmt::format("ply\nformat ascii 1.0\nelement vertex {}\n"
                                                       "property float x\nend_header\n",
                                                       gaussians)));
    return input_error([&] { compute_walkable_area(source, 2, [] {}); });
  };
  EXPECT_THAT(error(4'000'001), HasSubstr("--cache-dir"));
  EXPECT_THAT(error(4'000'000), Not(HasSubstr("--cache-dir")));
}

TEST(ComputedWalkableArea, LiesInTheCoordinatesOfAFarFile) {
  const TemporaryFolder folder;
  const auto area_at = [&](const glm::dvec3& at) {
    save_scene(room(0.9f), folder / "a.ply", 1, at);
    WalkableAreaSource source;
    source.scene = locate_scene(folder / "a.ply");
    source.start = at + glm::dvec3(2.0, 2.0, 1.6);
    source.up = {0, 0, 1};
    source.metres_per_unit = 1.0f;
    return map_in(compute_walkable_area(source, 2, [] {}));
  };
  const glm::dvec3 there(500123.0, 5412345.0, 431.0);
  const walk::WalkMap near = area_at({0.0, 0.0, 0.0}), far = area_at(there);
  EXPECT_EQ(near.origin, glm::dvec3(0.0));
  EXPECT_LT(glm::distance(far.origin, there), 30.0);
  const glm::dvec3 moved =
      glm::dvec3(far.grid.origin) + far.origin - glm::dvec3(near.grid.origin) - there;
  EXPECT_LT(glm::length(moved), 1e-3);
  EXPECT_EQ(far.size, near.size);
  const auto places = static_cast<double>(near.positions.size());
  EXPECT_NEAR(static_cast<double>(far.positions.size()), places, 0.01 * places);
}

/// The public demo: its ground is found without its file.
TEST(ComputedWalkableArea, IsFoundInAProceduralScene) {
  WalkableAreaSource source;
  source.scene.given = "synth:stress:100000";
  source.start = {0, -1.6f, -5};
  source.up = {0, -1, 0};
  source.metres_per_unit = 1.0f;
  std::atomic<int> calls = 0;
  const std::string bytes = compute_walkable_area(source, 2, [&] { ++calls; });
  EXPECT_GT(map_in(bytes).positions.size(), 1000u);
  struct Stop {};
  for (const int last : {1, calls / 2, calls - 1}) {
    std::atomic<int> left = last;
    EXPECT_THROW(compute_walkable_area(source, 2,
                                       [&] {
                                         if (--left == 0) throw Stop();
                                       }),
                 Stop)
        << last;
  }
  source.start = {0, -1e5f, 0};
  EXPECT_THROW(compute_walkable_area(source, 2, [] {}), NoWalkableArea);
}

}  // namespace
}  // namespace catgs::test
