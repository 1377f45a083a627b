// Culling: which clusters and which Gaussians are in view, against ListCuller on the host and the
// CPU core's projection.

#include <set>

#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

class CullStage : public ListStage {};

TEST_P(CullStage, FindsWhatTheCpuCoreFinds) {
  const StagedCase staged(GetParam(), 50'000);
  const StagedScene scene(staged.cloud);
  StagedLists lists(scene, staged.camera, staged.plan, staged.settings);
  lists.cull();
  const FrameCounts counts = lists.counts();
  const SceneArrays& arrays = scene.device.arrays();

  const auto bounds = fetch(arrays.clusters, arrays.cluster_count);
  const auto clusters = fetch(lists.memory().clusters.get(), counts.clusters);
  EXPECT_TRUE(std::ranges::is_sorted(clusters));
  const std::set<std::uint32_t> in_sight(clusters.begin(), clusters.end());
  {
    // Rounding differs by whether products and sums are contracted.
    Mismatches sight("cull: clusters in sight", 0.005);
    for (std::uint32_t c = 0; c < arrays.cluster_count; ++c)
      sight.add(in_sight.contains(c) == lists.request().culler.outside(bounds[c]));
  }

  const auto visible = fetch(lists.memory().visible.get(), counts.visible);
  EXPECT_EQ(lists.memory().list_counts.get()->visible, counts.visible);
  EXPECT_TRUE(std::ranges::is_sorted(visible));
  std::vector<bool> on_device(scene.cloud.size());
  for (const std::uint32_t i : visible) on_device[scene.order[i]] = true;
  // The CPU core asks for a pixel centre in a Gaussian's box, the CUDA core for any place of the
  // picture; and packing has rounded what the CUDA core sees.
  Mismatches missing("cull: Gaussians of the CPU core that are missing", 0.001);
  Mismatches added("cull: Gaussians that the CPU core does not have", 0.03);
  const auto on_cpu = lists.on_cpu();
  for (std::size_t i = 0; i < on_cpu.size(); ++i) {
    if (on_cpu[i]) missing.add(!on_device[i]);
    if (on_device[i]) added.add(!on_cpu[i]);
  }
}

INSTANTIATE_TEST_SUITE_P(, CullStage, testing::Values(Listed::now, Listed::window), name_of);

}  // namespace
}  // namespace catgs::cuda::stages
