// Real files from the shared folder; skipped where it is absent.
#include <tuple>

#include "render_core/scene/analysis/up_axis.h"
#include "render_core/scene/analysis/voxel_grid.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/scene.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/shared_folder.h"

namespace catgs::test {
namespace {

class SharedScenes : public ::testing::Test {
 protected:
  void SetUp() override {
    if (scenes_.empty()) GTEST_SKIP() << "no shared folder scenes";
  }

  static void expect_sound(const Scene& scene) {
    const Bounds& limits = scene.hints.limits;
    const glm::vec3& eye = scene.hints.start_pose.position;
    for (int k = 0; k < 3; ++k) {
      EXPECT_LT(limits.min[k], eye[k]);
      EXPECT_GT(limits.max[k], eye[k]);
    }
    const VoxelGrid grid(scene.cloud, limits);
    EXPECT_LT(grid.depth_around(eye), 0.2f) << "the first pose is inside of something";
  }

  const std::filesystem::path scenes_ = shared_folder("scenes");
};

TEST_F(SharedScenes, SingleFiles) {
  const std::array<std::tuple<const char*, const char*, std::size_t, int>, 2> files = {
      {{"skull.sog", "sog v2 (zip)", 94936, 3},
       {"guitar.compressed.ply", "compressed ply", 90854, 0}}};
  for (const auto& [file, format, gaussians, sh_degree] : files) {
    const Scene scene = load_scene(scenes_ / file);
    EXPECT_EQ(scene.format, format);
    EXPECT_EQ(scene.report.read, gaussians);
    EXPECT_EQ(scene.cloud.sh_degree, sh_degree);
    expect_sound(scene);
  }
}

TEST_F(SharedScenes, AHalfTurnTurnsUpOver) {
  for (const char* file : {"skull.sog", "guitar.compressed.ply", "playbot"}) {
    GaussianCloud cloud = load_scene(scenes_ / file).cloud;
    EXPECT_LT(find_up(cloud, {}).y, -0.98f) << file;
    const glm::quat half(0, 1, 0, 0);
    for (glm::vec3& mean : cloud.mean) mean = half * mean;
    for (glm::quat& rotation : cloud.rotation) rotation = half * rotation;
    EXPECT_GT(find_up(cloud, {}).y, 0.98f) << file;
  }
}

TEST_F(SharedScenes, StreamedSogLevels) {
  const std::array<std::size_t, 7> counts = {500000, 250000, 125000, 31000, 8406, 3000, 1873};
  for (int level = 0; level < 7; ++level) {
    LoadOptions options;
    options.lod = level;
    const Scene scene = load_scene(scenes_ / "playbot", options);
    EXPECT_EQ(scene.report.read, counts[static_cast<std::size_t>(level)]) << "level " << level;
    EXPECT_EQ(scene.cloud.sh_degree, 2);
    expect_sound(scene);
  }
  EXPECT_EQ(load_scene(scenes_ / "playbot").report.read, 500000u);
  EXPECT_EQ(load_scene(scenes_ / "playbot" / "lod-meta.json").report.read, 500000u);
  EXPECT_EQ(load_scene(scenes_ / "playbot" / "3_0").report.read, 31000u);
}

TEST_F(SharedScenes, StreamedSogBudgets) {
  const std::array<std::tuple<std::size_t, std::size_t>, 4> cases = {
      {{1873, 1873}, {18000, 8406}, {20000, 19632}, {1000000, 500000}}};
  for (const auto& [budget, loaded] : cases) {
    LoadOptions options;
    options.gaussian_budget = budget;
    EXPECT_EQ(load_scene(scenes_ / "playbot", options).report.read, loaded);
  }
}

}  // namespace
}  // namespace catgs::test
