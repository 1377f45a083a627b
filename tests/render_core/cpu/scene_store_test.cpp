#include "render_core/cpu/scene_store.h"

#include <gtest/gtest.h>

#include "render_core/math/projection-inl.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {
namespace {

// Memory that the system has taken back reads as zeros.
TEST(SceneStore, ForgottenClustersGiveTheirMemoryBack) {
  constexpr std::size_t clusters = 48;
  const GaussianCloud cloud = random_cloud(cluster_size, 3, 5);
  const std::vector<math::CovarianceFactor<double>> factors(cluster_size, {1, 1, 1, 1, 1, 1});
  SceneStore store(clusters, 3, SplatModel::standard);
  for (std::size_t c = 0; c < clusters; ++c) store.put(c, cloud, factors, 7);
  store.forget(16, 16);
  const auto value = [&](std::size_t c) {
    return store.attribute(SceneStore::factor_xx)[c * cluster_size];
  };
  EXPECT_EQ(value(24), 0.0f);
  EXPECT_EQ(store.scene_order()[24 * cluster_size], 0u);
  EXPECT_EQ(store.sh_of_packet(24 * cluster_size / packet_size)[0], 0.0f);
  for (const std::size_t c : {15, 32}) {
    EXPECT_EQ(value(c), 1.0f) << "a neighbour";
    EXPECT_EQ(store.scene_order()[c * cluster_size], 7u);
    EXPECT_NE(store.sh_of_packet(c * cluster_size / packet_size)[0], 0.0f);
  }
}

}  // namespace
}  // namespace catgs::test
