// The stages of the CPU core one by one, for every instruction set: projection and shading against
// double precision, tile lists against brute force over pixels.

#include "render_core/cpu/kernels.h"

#include <bit>
#include <cmath>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/cpu/tile_lists.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/projection-inl.h"
#include "render_core/math/spherical_harmonics-inl.h"
#include "tests/support/picked.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

using test::TestScene;

/// The visible splats of a scene, cluster after cluster as the core keeps them.
struct Projected {
  std::vector<Splat> splats;
  std::vector<std::uint32_t> counts;
  [[nodiscard]] SplatTable table() const { return {splats, nullptr, counts, {}}; }
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (std::size_t rank = 0; rank < counts.size(); ++rank)
      for (std::uint32_t i = 0; i < counts[rank]; ++i)
        visit(rank * cluster_size + i, splats[rank * cluster_size + i]);
  }
};

Projected project_all(const SceneStore& store, const Camera& camera, const SimdKernels& kernels,
                      Pipeline pipeline = Pipeline::exact) {
  Projected out;
  out.splats.resize(store.clusters().size() * cluster_size);
  for (std::size_t c = 0; c < store.clusters().size(); ++c)
    out.counts.push_back(kernels
                             .project_cluster({&store, &camera, pipeline, c,
                                               out.splats.data() + c * cluster_size, 0.0f})
                             .visible);
  return out;
}

void fill(TileLists& lists, const Projected& projected, glm::ivec2 grid, std::uint64_t max_entries,
          const SimdKernels& kernels, ThreadPool& pool) {
  constexpr std::size_t segments = 3;
  lists.begin(grid, segments, max_entries);
  for (std::size_t rank = 0; rank < projected.counts.size(); ++rank) {
    lists.add(rank * segments / projected.counts.size(), projected.table().of_cluster(rank),
              kernels);
  }
  lists.finish(projected.table(), kernels, pool);
}

math::Vec3<double> to_double(const glm::vec3& v) { return {v.x, v.y, v.z}; }

/// Exponent of a splat at a pixel centre, in double from its stored numbers.
double exponent_at(const Splat& s, double x, double y) {
  const math::Whitening<double> w{s.whitening_xx, s.whitening_xy, s.whitening_yy};
  return s.log2_opacity - math::whitened_square(w, {x - s.centre_x, y - s.centre_y});
}

class Kernels : public testing::TestWithParam<TestScene> {
 protected:
  ThreadPool pool_{2};
  const TestScene& scene_ = GetParam();
  const GaussianCloud cloud_ = test::in_cluster_order(*scene_.cloud, pool_);
  SceneStore store_{cloud_, pool_};
  const Camera& camera_ = scene_.request.camera;
  glm::ivec2 grid_ = (camera_.size_px + 15) / 16;
};

TEST_P(Kernels, ProjectionAndShadingMatchDoublePrecision) {
  const auto model = math::make_camera_model(camera_);
  const GaussianCloud& cloud = cloud_;
  for (const SimdKernels& kernels : simd_kernels()) {
    SCOPED_TRACE(std::string(kernels.name));
    project_all(store_, camera_, kernels).for_each([&](std::size_t, const Splat& s) {
      const std::uint32_t i = s.scene_order;
      const auto mean = to_double(cloud.mean[i]);
      const double depth = math::view_depth(model, mean);
      EXPECT_EQ(s.depth, static_cast<float>(depth));  // the order of blending depends on it

      const glm::quat& q = cloud.rotation[i];
      const double rotation[4] = {q.x, q.y, q.z, q.w};
      const auto factor = math::covariance_factor(rotation, to_double(cloud.scale[i]));
      const auto p = math::project(model, mean, factor, depth);
      const double far = std::abs(p.centre_px.x) + std::abs(p.centre_px.y);
      EXPECT_NEAR(s.centre_x, p.centre_px.x, 2e-4 + 2e-6 * far);
      EXPECT_NEAR(s.centre_y, p.centre_px.y, 2e-4 + 2e-6 * far);
      const auto w = math::whitening(p);
      // Relative to the axis across a needle, which is what its image depends on.
      const double tolerance = 3e-5 * (std::abs(w.xx) + std::abs(w.xy) + w.yy);
      EXPECT_NEAR(s.whitening_xx, w.xx, tolerance);
      EXPECT_NEAR(s.whitening_xy, w.xy, tolerance);
      EXPECT_NEAR(s.whitening_yy, w.yy, tolerance);

      double basis[16];
      math::sh_basis(math::view_direction(model.position, mean), cloud.sh_degree, basis);
      glm::dvec3 sum(0.0);
      for (int k = 0; k < cloud.sh_count(); ++k) sum += basis[k] * glm::dvec3(cloud.sh_of(i)[k]);
      EXPECT_NEAR(s.red, math::colour_from_sh_sum(sum.x), 2e-6);
      EXPECT_NEAR(s.green, math::colour_from_sh_sum(sum.y), 2e-6);
      EXPECT_NEAR(s.blue, math::colour_from_sh_sum(sum.z), 2e-6);
    });
  }
}

TEST_P(Kernels, NoVisibleGaussianIsCulled) {
  const auto model = math::make_camera_model(camera_);
  const GaussianCloud& cloud = cloud_;
  std::set<std::uint32_t> visible;
  project_all(store_, camera_, simd_kernels().front()).for_each([&](std::size_t, const Splat& s) {
    visible.insert(s.scene_order);
  });

  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    const auto mean = to_double(cloud.mean[i]);
    const double depth = math::view_depth(model, mean);
    if (static_cast<float>(depth) <= camera_.near_z || visible.contains(i)) continue;
    const glm::quat& q = cloud.rotation[i];
    const double rotation[4] = {q.x, q.y, q.z, q.w};
    const auto p = math::project(
        model, mean, math::covariance_factor(rotation, to_double(cloud.scale[i])), depth);
    double log2_opacity = std::log2(static_cast<double>(cloud.opacity[i]));
    if (cloud.model == SplatModel::antialiased)
      log2_opacity = math::antialiased_log2_opacity(log2_opacity, p);
    const double reach = math::reach_of(log2_opacity);
    if (reach < 0.0) continue;
    const auto w = math::whitening(p);
    for (int y = 0; y < camera_.size_px.y; ++y)
      for (int x = 0; x < camera_.size_px.x; ++x)
        ASSERT_GT(math::whitened_square(w, {x + 0.5 - p.centre_px.x, y + 0.5 - p.centre_px.y}),
                  reach)
            << "Gaussian " << i << " reaches pixel " << x << "," << y;
  }
}

TEST_P(Kernels, CulledClustersHaveNothingVisible) {
  const Projected all = project_all(store_, camera_, simd_kernels().front());
  const ClusterCuller culler(camera_);
  for (std::size_t c = 0; c < all.counts.size(); ++c)
    EXPECT_TRUE(!culler.outside(store_.clusters()[c]) || all.counts[c] == 0) << "cluster " << c;
}

TEST_P(Kernels, ListsMissNoTileAndAddFew) {
  for (const SimdKernels& kernels : simd_kernels()) {
    SCOPED_TRACE(std::string(kernels.name));
    const Projected projected = project_all(store_, camera_, kernels);
    TileLists lists;
    fill(lists, projected, grid_, 1u << 30, kernels, pool_);
    std::set<std::pair<std::size_t, std::uint32_t>> listed;
    for (std::size_t tile = 0; tile < lists.tiles(); ++tile)
      for (const DepthSlot& entry : lists.list(tile))
        EXPECT_TRUE(listed.emplace(tile, entry.value).second) << "listed twice";

    std::size_t idle = 0;  // entries without a pixel that the splat reaches
    projected.for_each([&](std::size_t slot, const Splat& s) {
      for (int tile = 0; tile < grid_.x * grid_.y; ++tile) {
        const glm::ivec2 first = glm::ivec2(tile % grid_.x, tile / grid_.x) * 16;
        const glm::ivec2 end = glm::min(first + 16, camera_.size_px);
        bool reaches = false;
        for (int y = first.y; y < end.y; ++y)
          for (int x = first.x; x < end.x; ++x)
            reaches |= exponent_at(s, x + 0.5, y + 0.5) >= log2_alpha_min;
        const bool is_listed = listed.contains({tile, static_cast<std::uint32_t>(slot)});
        EXPECT_TRUE(!reaches || is_listed) << "tile " << tile << " misses slot " << slot;
        idle += is_listed && !reaches;
      }
    });
    // Exact for rectangles of pixel centres: a sliver may slip between centres. Boxes in one row or
    // column of tiles are listed untested: their corners may stay empty.
    EXPECT_LE(static_cast<double>(idle), 0.09 * static_cast<double>(lists.entries()) + 8.0);
  }
}

TEST_P(Kernels, ListsAreInDepthOrderWithTiesInSceneOrder) {
  const Projected projected = project_all(store_, camera_, simd_kernels().front());
  TileLists filled, keyed;
  fill(filled, projected, grid_, 1u << 30, simd_kernels().front(), pool_);
  filled.sort(projected.splats, pool_);
  keyed.build_by_keys(projected.table(), grid_, 1u << 30, pool_);
  for (const TileLists* lists : {&filled, &keyed}) {
    for (std::size_t tile = 0; tile < lists->tiles(); ++tile) {
      const auto list = lists->list(tile);
      for (std::size_t i = 1; i < list.size(); ++i) {
        const Splat& before = projected.splats[list[i - 1].value];
        const Splat& after = projected.splats[list[i].value];
        ASSERT_TRUE(before.depth < after.depth ||
                    (before.depth == after.depth && before.scene_order < after.scene_order));
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, Kernels, testing::ValuesIn(test::small_scenes()),
                         [](const auto& test) { return test.param.name; });

/// Depth order of a splat and how many entries it has in all lists.
std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint64_t> entries_by_splat(
    const TileLists& lists) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint64_t> entries;
  for (std::size_t tile = 0; tile < lists.tiles(); ++tile)
    for (const DepthSlot& entry : lists.list(tile)) ++entries[{entry.key, entry.value}];
  return entries;
}

TEST(TileListsBound, LeavesOutTheFarthestAndCountsThem) {
  ThreadPool pool(2);
  const TestScene scene = test::small_scenes().front();
  const Camera& camera = scene.request.camera;
  const glm::ivec2 grid = (camera.size_px + 15) / 16;
  const SceneStore store(*scene.cloud, pool);
  const SimdKernels& kernels = simd_kernels().front();
  const Projected exact = project_all(store, camera, kernels);
  const Projected boxes = project_all(store, camera, kernels, Pipeline::vanilla);

  const auto check = [&](const auto& build) {
    TileLists all, bounded;
    build(all, std::uint64_t{1} << 30);
    const auto wanted = entries_by_splat(all);
    for (const std::uint64_t bound : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{500},
                                      all.entries() / 2, all.entries() - 1, all.entries()}) {
      SCOPED_TRACE(bound);
      build(bounded, bound);
      EXPECT_LE(bounded.entries(), bound);
      EXPECT_EQ(bounded.entries() + bounded.overflowed_entries(), all.entries());
      // The kept ones are the nearest, whole, and as many as fit.
      const auto kept = entries_by_splat(bounded);
      ASSERT_TRUE(std::equal(kept.begin(), kept.end(), wanted.begin()));
      const auto next = std::next(wanted.begin(), static_cast<std::ptrdiff_t>(kept.size()));
      if (next != wanted.end()) {
        EXPECT_GT(bounded.entries() + next->second, bound);
      }
    }
  };
  check([&](TileLists& lists, std::uint64_t bound) {
    fill(lists, exact, grid, bound, kernels, pool);
  });
  check([&](TileLists& lists, std::uint64_t bound) {
    lists.build_by_keys(boxes.table(), grid, bound, pool);
  });
}

TEST(SortList, EqualsStableSortOnAnyDistribution) {
  std::uint64_t state = 1;
  const auto random = [&state] {
    state = state * 6364136223846793005u + 1442695040888963407u;
    return static_cast<std::uint32_t>(state >> 33);
  };
  for (const std::size_t size : {0u, 1u, 2u, 23u, 24u, 25u, 300u, 5000u}) {
    for (const std::uint32_t range : {1u, 3u, 1000u, 70000u, 0x7f800000u}) {
      std::vector<DepthSlot> list(size), scratch(size);
      for (std::uint32_t i = 0; i < size; ++i) list[i] = {random() % range, i};
      // One outlier pushes all others into the same leading bits.
      if (size > 30 && range == 1000u) list[7].key = 0x7f000000u;
      std::vector<DepthSlot> expected = list;
      std::ranges::stable_sort(expected, {}, &DepthSlot::key);
      sort_list(std::span(list), std::span(scratch),
                [](const DepthSlot& a, const DepthSlot& b) { return a.value < b.value; });
      for (std::size_t i = 0; i < size; ++i) {
        ASSERT_EQ(list[i].key, expected[i].key);
        ASSERT_EQ(list[i].value, expected[i].value);
      }
    }
  }
}

}  // namespace
}  // namespace catgs
