// The promise of a key frame's lists: whatever camera of the guard set draws a sub-frame, no pixel
// misses a Gaussian that reaches it with alpha >= 1/255. By brute force over all Gaussians, in
// double precision, at a sample of pixels.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/pixel_blocks.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/cpu/tile_lists.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/projection-inl.h"
#include "render_core/motion/anchor.h"
#include "render_core/motion/frame_groups.h"
#include "render_core/motion/list_culler.h"
#include "render_core/motion/predictor.h"
#include "render_core/motion/script.h"
#include "render_core/motion/trajectory.h"
#include "render_core/synth/synth.h"

namespace catgs {
namespace {

math::Vec3<double> to_double(const glm::vec3& v) { return {v.x, v.y, v.z}; }

/// The lists of a key frame and the Gaussians in them, as the core makes them.
struct KeyLists {
  std::vector<Splat> splats;
  std::vector<SplatPath> paths;
  std::vector<ClusterMembers> members;
  std::vector<std::uint32_t> counts;
  TileLists lists;
};

void list(const SceneStore& store, const Camera& camera, const FramePlan& plan, ThreadPool& pool,
          KeyLists& key) {
  const SimdKernels& kernels = simd_kernels().front();
  const ListCuller culler(camera, plan);
  const std::size_t clusters = store.clusters().size();
  key.splats.resize(clusters * cluster_size);
  key.paths.resize(clusters * cluster_size);
  key.members.resize(clusters);
  key.counts.assign(clusters, 0);
  key.lists.begin(plan.grid.tiles, 1, std::uint64_t{1} << 30);
  const auto table = [&] {
    return SplatTable{key.splats, key.paths.data(), key.counts, plan.grid.first_px};
  };
  for (std::size_t c = 0; c < clusters; ++c) {
    if (culler.outside(store.clusters()[c])) continue;
    const std::size_t first = c * cluster_size;
    key.counts[c] = kernels
                        .project_cluster({.scene = &store,
                                          .camera = &camera,
                                          .plan = &plan,
                                          .pipeline = Pipeline::catgs,
                                          .cluster = c,
                                          .splats = key.splats.data() + first,
                                          .min_depth = 0.0f,
                                          .paths = key.paths.data() + first,
                                          .members = &key.members[c]})
                        .visible;
    key.lists.add(0, table().of_cluster(c), kernels);
  }
  key.lists.finish(table(), kernels, pool);
}

/// Gaussians of the scene that reach a pixel's centre, drawn by `camera`.
class BruteForce {
 public:
  BruteForce(const GaussianCloud& cloud, const Camera& camera) {
    const auto model = math::make_camera_model(camera);
    for (std::uint32_t i = 0; i < cloud.size(); ++i) {
      const auto mean = to_double(cloud.mean[i]);
      const double depth = math::view_depth(model, mean);
      const double reach = math::reach_of(std::log2(static_cast<double>(cloud.opacity[i])));
      if (!(static_cast<float>(depth) > camera.near_z) || reach < 0.0) continue;
      const glm::quat& q = cloud.rotation[i];
      const double rotation[4] = {q.x, q.y, q.z, q.w};
      const auto p = math::project(
          model, mean, math::covariance_factor(rotation, to_double(cloud.scale[i])), depth);
      splats_.push_back({i, p.centre_px, math::whitening(p), reach});
    }
  }

  template <class Visit>
  void at(const glm::dvec2& pixel, const Visit& visit) const {
    for (const Drawn& s : splats_) {
      const math::Vec2<double> d{pixel.x - s.centre_px.x, pixel.y - s.centre_px.y};
      if (math::whitened_square(s.whitening, d) <= s.reach) visit(s.index);
    }
  }

 private:
  struct Drawn {
    std::uint32_t index;
    math::Vec2<double> centre_px;
    math::Whitening<double> whitening;
    double reach;
  };
  std::vector<Drawn> splats_;
};

class GuardSetLists : public testing::Test {
 protected:
  void follow_and_expect_all(const Trajectory& path, int least_sub_frames) {
    sub_frames_ = 0;
    pairs_ = missed_ = 0;
    follow(path);
    EXPECT_GE(sub_frames_, least_sub_frames);
    EXPECT_GT(pairs_, 1000u);
    EXPECT_EQ(missed_, 0u) << "of " << pairs_;
  }

 private:
  /// Draws a path at 120 Hz with forecasts of its past, and looks at pixels of each sub-frame.
  void follow(const Trajectory& path) {
    FrameGroups groups({.grid = GridKind::warp});
    MotionPredictor predictor;
    KeyLists key;
    std::mt19937 random(1);
    for (const TimedPose& sample : path) {
      predictor.add(sample);
      const Camera camera = make_camera(sample.world_from_camera, {320, 192}, 183.0f);
      FramePlan plan = groups.plan(camera, predictor.forecast(sample.time_us, 120.0, 4), depths_);
      widen_for_blocks(plan, GridKind::warp);
      if (plan.window == 0) continue;
      if (plan.kind == FrameKind::key) {
        list(store_, camera, plan, pool_, key);
      } else {
        look(camera, plan, key, random);
        ++sub_frames_;
      }
    }
  }

  void look(const Camera& camera, const FramePlan& plan, const KeyLists& key,
            std::mt19937& random) {
    constexpr int tiles = 4;
    const BruteForce truth(scene_.cloud, camera);
    PixelBlocks blocks;
    blocks.place(camera.size_px, plan);
    for (int k = 0; k < tiles; ++k) {
      const auto tile = static_cast<std::size_t>(random() % key.lists.tiles());
      const auto in_tile = blocks.of_tile(tile);
      if (in_tile.empty()) continue;
      std::set<std::uint32_t> listed;
      for (const DepthSlot& entry : key.lists.list(tile))
        listed.insert(key.splats[entry.value].original_index);
      for (const PixelBlock& block : in_tile) {
        const glm::dvec2 pixel =
            glm::dvec2(block.x, block.y) + glm::dvec2(random() % 4, random() % 4) + 0.5;
        truth.at(pixel, [&](std::uint32_t index) {
          ++pairs_;
          missed_ += listed.contains(index) ? 0 : 1;
        });
      }
    }
  }

  ThreadPool pool_{2};

 protected:
  Scene scene_ = synthesize(SynthKind::city, 20'000, 1, pool_);

 private:
  SceneStore store_{scene_.cloud, pool_};
  SceneDepths depths_{4.0f, 0.1f};
  int sub_frames_ = 0;
  std::size_t pairs_ = 0, missed_ = 0;
};

TEST_F(GuardSetLists, MissNothingOnScripts) {
  for (const std::string script : {"walk", "head", "drone", "orbit"}) {
    SCOPED_TRACE(script);
    follow_and_expect_all(make_script({.script = script, .duration_s = 0.6}, scene_.hints), 20);
  }
}

TEST_F(GuardSetLists, MissNothingOnFastTurnsAboutAnyAxis) {
  for (const glm::vec3 axis : {glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1)}) {
    SCOPED_TRACE(testing::Message() << axis.x << " " << axis.y << " " << axis.z);
    Trajectory path;
    for (int k = 0; k < 60; ++k) {
      Pose pose = scene_.hints.start_pose;
      pose.orientation = pose.orientation * glm::angleAxis(0.012f * static_cast<float>(k), axis);
      path.push_back({k * std::int64_t{8333}, pose});
    }
    follow_and_expect_all(path, 20);
  }
}

TEST_F(GuardSetLists, MissNothingOnRecordedHeads) {
  const char* shared = std::getenv("CATGS_SHARED_DIR");
  const auto folder =
      (shared != nullptr ? std::filesystem::path(shared)
                         : std::filesystem::path(CATGS_SOURCE_DIR).parent_path() / "shared") /
      "traces/head";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "no folder " << folder;
  int traces = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    if (file.path().extension() != ".tum") continue;
    SCOPED_TRACE(file.path().filename().string());
    Trajectory path = resample(anchored(read_tum(file.path()), scene_.hints), 120.0);
    // A part with much motion in it; all of it would take minutes.
    const std::size_t first = std::min<std::size_t>(600, path.size() / 2);
    path =
        Trajectory(path.begin() + static_cast<std::ptrdiff_t>(first),
                   path.begin() + static_cast<std::ptrdiff_t>(std::min(first + 60, path.size())));
    follow_and_expect_all(path, 10);
    ++traces;
  }
  EXPECT_GT(traces, 0);
}

TEST(PixelBlocks, HoldEveryBlockOnceHoweverTheGridIsTurned) {
  const Camera key = make_camera({}, {150, 90}, 120.0f);
  for (const glm::vec3 turn : {glm::vec3(0), glm::vec3(0, 0.08f, 0), glm::vec3(-0.05f, 0, 0.3f)}) {
    Pose pose;
    pose.orientation = glm::quat(turn);
    FramePlan plan;
    plan.grid = make_guard_set(key, pose, 0.0).grid;
    plan.list_from_frame = image_turn(key, pose);
    PixelBlocks blocks;
    blocks.place(key.size_px, plan);
    std::set<std::pair<int, int>> seen;
    for (int tile = 0; tile < plan.grid.tiles.x * plan.grid.tiles.y; ++tile) {
      for (const PixelBlock& block : blocks.of_tile(static_cast<std::size_t>(tile))) {
        EXPECT_TRUE(seen.emplace(block.x, block.y).second);
        EXPECT_TRUE(block.x % block_side_px == 0 && block.y % block_side_px == 0);
        EXPECT_TRUE(block.x < key.size_px.x && block.y < key.size_px.y);
      }
    }
    EXPECT_EQ(seen.size(), 38u * 23u);
  }
}

}  // namespace
}  // namespace catgs
