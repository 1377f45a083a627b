// The promise of a key frame's lists in Pipeline::paper: while the camera keeps to the forecast, no
// pixel of a sub-frame misses a Gaussian that reaches it with alpha >= 1/255. By brute force over
// all Gaussians, in double precision, at a sample of pixels.

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/cpu/tile_lists.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/projection-inl.h"
#include "render_core/motion/frame_groups.h"
#include "render_core/motion/list_culler.h"
#include "render_core/synth/synth.h"
#include "tests/support/camera_moves.h"
#include "tests/support/picked.h"

namespace catgs {
namespace {

math::Vec3<double> to_double(const glm::vec3& v) { return {v.x, v.y, v.z}; }

/// The lists of a key frame and the Gaussians in them, as the core makes them.
struct KeyListsOf {
  std::vector<Splat> splats;
  std::vector<SplatPath> paths;
  std::vector<ClusterMembers> members;
  std::vector<std::uint32_t> counts;
  TileLists lists;
};

void list(const SceneStore& store, const Camera& camera, const FramePlan& plan, ThreadPool& pool,
          KeyListsOf& key) {
  const SimdKernels& kernels = simd_kernels().front();
  const ListCuller culler(camera, plan);
  const std::size_t clusters = store.clusters().size();
  key.splats.resize(clusters * cluster_size);
  key.paths.resize(clusters * cluster_size);
  key.members.resize(clusters);
  key.counts.assign(clusters, 0);
  key.lists.begin((camera.size_px + 15) / 16, 1, std::uint64_t{1} << 30);
  const auto table = [&] { return SplatTable{key.splats, key.paths.data(), key.counts, {}}; };
  for (std::size_t c = 0; c < clusters; ++c) {
    if (culler.outside(store.clusters()[c])) continue;
    const std::size_t first = c * cluster_size;
    key.counts[c] = kernels
                        .project_cluster({.scene = &store,
                                          .camera = &camera,
                                          .pipeline = Pipeline::paper,
                                          .cluster = c,
                                          .splats = key.splats.data() + first,
                                          .min_depth = 0.0f,
                                          .window_end = &plan.window_end,
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

TEST(KeyLists, MissNothingOnTheForecastPath) {
  ThreadPool pool(2);
  const Scene scene = synthesize(SynthKind::city, 20'000, 1, pool);
  const GaussianCloud cloud = test::in_cluster_order(scene.cloud, pool);
  const SceneStore store(cloud, pool);
  std::mt19937 random(1);
  for (const test::Move& move : test::moves()) {
    SCOPED_TRACE(move.name);
    const Pose start = scene.hints.start_pose, end = test::moved(start, move);
    const auto camera_at = [&](float share) {
      return make_camera(uniform_motion(start, end, share), {320, 192}, 183.0f);
    };
    FrameGroups groups(test::patient_settings().speculation);
    const FramePlan plan = groups.plan(camera_at(0.0f), Forecast{end, test::window}, 4.0f);
    ASSERT_EQ(plan.window, test::window);
    KeyListsOf key;
    list(store, camera_at(0.0f), plan, pool, key);
    std::size_t pairs = 0, missed = 0;
    for (const float share : {0.25f, 0.6f, 1.0f}) {
      const BruteForce truth(cloud, camera_at(share));
      for (int k = 0; k < 80; ++k) {
        const glm::ivec2 pixel(random() % 320, random() % 192);
        const auto tile = static_cast<std::size_t>(pixel.y / 16 * 20 + pixel.x / 16);
        std::set<std::uint32_t> listed;
        for (const DepthSlot& entry : key.lists.list(tile))
          listed.insert(key.splats[entry.value].scene_order);
        truth.at(glm::dvec2(pixel) + 0.5, [&](std::uint32_t index) {
          ++pairs;
          missed += listed.contains(index) ? 0 : 1;
        });
      }
    }
    EXPECT_GT(pairs, 1000u);
    EXPECT_EQ(missed, 0u);
  }
}

}  // namespace
}  // namespace catgs
