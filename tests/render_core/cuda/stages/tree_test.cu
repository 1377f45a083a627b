// The cut of a tree: each node by itself, against the walk on the host.

#include <map>

#include "render_core/cuda/device_pages.cuh"
#include "tests/render_core/cuda/stages/stage.h"
#include "tests/render_core/scene/tree/tree_test_support.h"
#include "tests/support/test_scenes.h"

namespace catgs::cuda::stages {
namespace {

__global__ void find_shares(const TreeCut cut, const Cluster* clusters) {
  const std::uint32_t n = blockIdx.x * blockDim.x + threadIdx.x;
  if (n < cut.tree.nodes()) cut.share[cut.tree.cluster_of(n)] = cut.share_of(clusters, n);
}

/// The share of each node that the walk on the host draws, by its place on the device.
std::vector<float> shares_on_host(const PageTable& table, const Camera& camera, float detail_px,
                                  double now_s, std::uint32_t clusters) {
  std::vector<float> shares(clusters, 0.0f);
  for (const auto& [node, share] : table.cut(std::span(&camera, 1), detail_px, now_s).drawn)
    shares[table.cluster_of(node, clusters_per_slot)] = share;
  return shares;
}

class TreeCutStage : public StageTest {};

TEST_F(TreeCutStage, SharesAreThoseOfTheWalk) {
  for (const int degree : {0, 3}) {
    ThreadPool pool(2);
    const auto tree = std::make_shared<TreeFile>(
        test::source_of(test::tree_bytes(test::random_cloud(100'000, degree, 31), pool)));
    // One device has room for all pages, and one for a third of them.
    const std::uint64_t all = tree->shape().pages() * tree->shape().page_bytes();
    for (const std::uint64_t memory : {2 * all, all / 3}) {
      RendererOptions options;
      options.scene_memory = memory;
      const DeviceScene scene(tree, options, 0);
      const std::uint32_t count = scene.arrays().cluster_count;
      DeviceBuffer<float> shares;
      shares.reserve(count);
      const auto watch = scene.tree()->watch();
      Mismatches wrong("tree: shares of nodes", 0.002);
      for (int step = 0; step < 20; ++step) {
        const float distance = 4.0f * std::pow(1.3f, static_cast<float>(step));
        const Camera camera =
            make_camera(test::look_at({0, 0, 5 - distance}, {0, 0, 5}), {640, 360}, 500.0f);
        // Half of the steps catch pages while they are blended in.
        watch->look({{camera}, 0.7f, step % 2 == 0});
        if (step % 2 == 0) scene.tree()->settle(*watch);
        const auto table = scene.tree()->table();
        const double now_s = scene.tree()->now_s();
        check(cudaMemset(shares.get(), 0, count * sizeof(float)), "shares");
        const TreeCut cut{.tree = scene.tree(*table),
                          .now = CutEye(camera),
                          .end = CutEye(camera),
                          .detail_px = 0.7f,
                          .now_s = now_s,
                          .share = shares.get()};
        find_shares<<<blocks_for(cut.tree.nodes(), 128), 128>>>(cut, scene.arrays().clusters);
        const auto found = fetch(shares.get(), count);
        const auto bounds = fetch(scene.arrays().clusters, count);
        const auto expected = shares_on_host(*table, camera, 0.7f, now_s, count);
        const ClusterCuller culler(camera);
        for (std::uint32_t c = 0; c < count; ++c) {
          if (found[c] > 0.0f && culler.outside(bounds[c])) continue;  // the walk leaves it out
          wrong.add(std::abs(found[c] - expected[c]) > 0.01f);
        }
      }
    }
  }
}

}  // namespace
}  // namespace catgs::cuda::stages
