// Projection and shading against the CPU core's: places, shapes, colours, depths and paths of the
// Gaussians in view.

#include <bit>

#include "render_core/math/constants.h"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

/// depth_key() in double precision.
double key_of(float depth, float near_z) {
  if (!(depth > near_z)) return 0.0;
  const double steps = static_cast<double>(std::bit_cast<std::uint32_t>(depth)) -
                       static_cast<double>(std::bit_cast<std::uint32_t>(near_z));
  const double keys = std::exp2(depth_bits);
  return std::min(steps * keys / (20.0 * (1 << 23)), keys - 1.0);
}

class ProjectStage : public ListStage {};

TEST_P(ProjectStage, SplatsAreThoseOfTheCpuCore) {
  const StagedCase staged(GetParam());
  const StagedScene scene(staged.cloud);
  StagedLists lists(scene, staged.camera, staged.plan, staged.settings);
  lists.cull();
  lists.project();
  const FrameCounts counts = lists.counts();
  const ViewMemory& m = lists.memory();
  const auto visible = fetch(m.visible.get(), counts.visible);
  const auto records = fetch(m.records.get(), counts.visible);
  const auto keys = fetch(m.depth.get(), counts.visible);
  const bool sweeps = GetParam() == Listed::window;
  const auto paths = sweeps ? fetch(m.path.get(), counts.visible) : std::vector<SplatPath>();

  // What packing rounds: shapes to 2^-15 of the largest entry of their factor, which a needle's
  // width feels thirty times, harmonics to 8 bits, colours to halves, opacities beside harmonics to
  // 12 bits.
  Difference position("project: centre, share of 1 px and its hundredth part off the middle", 1e-3);
  Difference shape("project: whitening, share of its entries' sum", 5e-3);
  Difference opacity("project: log2 of opacity", 2e-3), colour("project: colour", 0.02);
  Difference path("project: path, share of 1 px and its length", 5e-3);
  Difference depth("project: depth keys, steps", 1.05);  // keys are rounded down
  const auto on_cpu = lists.on_cpu();
  float nearest = std::numeric_limits<float>::infinity(), longest = 0.0f;
  for (std::size_t v = 0; v < visible.size(); ++v) {
    const auto& expected = on_cpu[scene.order[visible[v]]];
    if (!expected) continue;
    const catgs::Splat& e = expected->splat;
    if (e.log2_opacity == hidden_log2_opacity) continue;
    const SplatRecord& r = records[v];
    const double far = 1.0 + 0.01 * (std::abs(e.centre_x) + std::abs(e.centre_y));
    position.add((r.centre_px.x - e.centre_x) / far);
    position.add((r.centre_px.y - e.centre_y) / far);
    const double sum =
        std::abs(e.whitening_xx) + std::abs(e.whitening_xy) + std::abs(e.whitening_yy);
    shape.add((r.whitening.xx - e.whitening_xx) / sum);
    shape.add((r.whitening.xy - e.whitening_xy) / sum);
    shape.add((r.whitening.yy - e.whitening_yy) / sum);
    opacity.add(r.log2_opacity - e.log2_opacity);
    const float2 red_green = __half22float2(r.colour.red_green);
    colour.add(red_green.x - e.red);
    colour.add(red_green.y - e.green);
    colour.add(__half2float(r.colour.blue) - e.blue);
    depth.add(keys[v] - key_of(e.depth, staged.camera.near_z));
    if (e.depth > lists.request().min_depth) nearest = std::min(nearest, e.depth);
    if (!sweeps) continue;
    const double length = 1.0 + std::hypot(expected->path->dx, expected->path->dy);
    path.add((paths[v].dx - expected->path->dx) / length);
    path.add((paths[v].dy - expected->path->dy) / length);
    if (e.depth > lists.request().min_depth)
      longest = std::max(longest, std::hypot(expected->path->dx, expected->path->dy));
  }
  if (!sweeps) path.add(0.0);
  EXPECT_EQ(std::bit_cast<float>(~counts.nearness), nearest);
  EXPECT_NEAR(std::bit_cast<float>(counts.displacement), longest, 0.01f + 0.05f * longest);
}

INSTANTIATE_TEST_SUITE_P(, ProjectStage, testing::Values(Listed::now, Listed::window), name_of);

}  // namespace
}  // namespace catgs::cuda::stages
