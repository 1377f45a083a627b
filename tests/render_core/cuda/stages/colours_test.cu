// Which colours a frame shades, against the CPU core's ColourCache on the same clusters.

#include <random>

#include "render_core/cpu/colour_cache.h"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

constexpr std::size_t words = cluster_size / 32;  // of a cluster's bits

class ColourStage : public StageTest {};

TEST_F(ColourStage, ShadesWhatTheCpuCoreShades) {
  const GaussianCloud cloud = catgs::test::random_cloud(40'000, 0, 11);
  const StagedScene scene(cloud);
  const SceneArrays& arrays = scene.device.arrays();
  const std::size_t count = arrays.cluster_count;
  const auto bounds = fetch(arrays.clusters, count);
  const auto shaded_from = upload(std::vector<glm::vec3>(count, glm::vec3(0.0f)));
  const auto known = upload(std::vector<std::uint32_t>(count * words));
  const auto wanted = upload(std::vector<std::uint32_t>(count * words));
  const ColourArrays colours{.shaded_from = shaded_from.get(),
                             .known = known.get(),
                             .wanted = wanted.get(),
                             .colour = nullptr};
  const Stream stream;
  forget_colours(colours, arrays.cluster_count, stream.get());
  ColourCache cache(count);
  Mismatches shaded("colours: words of the Gaussians to be shaded", 0.0);
  std::mt19937_64 random(12);
  std::size_t kept = 0;
  for (int frame = 0; frame < 40; ++frame) {
    // Steps of 1 cm, among clusters that are 0 to 8 units away.
    const glm::vec3 position(0.01f * static_cast<float>(frame), 0.0f, 0.0f);
    std::vector<std::uint32_t> in_sight, visible;
    for (std::uint32_t c = 0; c < count; ++c) {
      if (random() % 3 == 0) continue;
      in_sight.push_back(c);
      for (std::size_t w = 0; w < words; ++w)
        visible.push_back(static_cast<std::uint32_t>(random() & random()));
    }
    FrameCounts counts;
    counts.clusters = static_cast<std::uint32_t>(in_sight.size());
    const auto on_device = upload(std::vector{counts});
    const auto clusters = upload(in_sight), mask = upload(visible);
    launch_want_colours({.scene = arrays,
                         .position = position,
                         .counts = on_device.get(),
                         .clusters = clusters.get(),
                         .mask = mask.get(),
                         .colours = colours},
                        stream.get());
    const auto wanted_now = fetch(wanted.get(), count * words);
    for (std::size_t rank = 0; rank < in_sight.size(); ++rank) {
      const std::uint32_t c = in_sight[rank];
      ClusterMembers& known_there = *cache.of_cluster(c, bounds[c], position).shaded;
      for (std::size_t w = 0; w < words; ++w) {
        const std::uint32_t expected = visible[rank * words + w] & ~known_there[w];
        shaded.add(wanted_now[c * words + w] != expected);
        kept += (visible[rank * words + w] & known_there[w]) != 0 ? 1 : 0;
        known_there[w] |= visible[rank * words + w];
      }
    }
  }
  EXPECT_GT(kept, 1000u);  // the case is the one meant: colours are kept, and lost
}

}  // namespace
}  // namespace catgs::cuda::stages
