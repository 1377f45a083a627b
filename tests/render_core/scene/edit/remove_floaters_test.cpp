#include "render_core/scene/edit/remove_floaters.h"

#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/surface_clouds.h"

namespace catgs::test {
namespace {

std::size_t removed_from(GaussianCloud& cloud, int threads = 2) {
  ThreadPool pool(threads);
  return remove_floaters(cloud, pool);
}

void add_ball(GaussianCloud& cloud, const glm::vec3& mean, float size, float opacity = 0.9f) {
  cloud.resize(cloud.size() + 1, cloud.sh_degree);
  cloud.mean.back() = mean;
  cloud.scale.back() = glm::vec3(size);
  cloud.rotation.back() = glm::quat(1, 0, 0, 0);
  cloud.opacity.back() = opacity;
}

TEST(RemoveFloaters, FloatersGoAndSurfacesStay) {
  const GaussianCloud walls = room();
  GaussianCloud cloud = walls;
  // In the room, beyond it and far away; a clump of several; mist that nobody sees.
  add_ball(cloud, {1.0f, 0.0f, 0.5f}, 0.03f);
  add_ball(cloud, {0.0f, -6.0f, 0.0f}, 0.1f);
  add_ball(cloud, {300.0f, 10.0f, -40.0f}, 1.0f);
  for (int i = 0; i < 20; ++i)
    add_ball(cloud, {-1.0f + 0.01f * static_cast<float>(i), 0.3f, 0.2f}, 0.02f);
  add_ball(cloud, {0.5f, 0.4f, -0.5f}, 0.1f, 0.005f);
  EXPECT_EQ(removed_from(cloud), 24u);
  EXPECT_EQ(ply_bytes(cloud), ply_bytes(walls));
}

TEST(RemoveFloaters, GaussiansConnectedToASurfaceStay) {
  GaussianCloud cloud = room();
  for (int i = 0; i < 100; ++i)  // a cord from the ceiling
    add_ball(cloud, {0.0f, -1.5f + 0.01f * static_cast<float>(i), 0.0f}, 0.005f);
  EXPECT_EQ(removed_from(cloud), 0u);
}

TEST(RemoveFloaters, FarBackgroundsStay) {
  GaussianCloud cloud = room();
  const std::size_t count = cloud.size();
  GaussianCloud sky = ball(1.0f);
  for (std::size_t i = 0; i < sky.size(); i += 5)
    add_ball(cloud, 500.0f * glm::normalize(sky.mean[i]), 15.0f, 0.9f);
  EXPECT_EQ(removed_from(cloud), 0u);
  EXPECT_EQ(cloud.size(), count + 4000);
}

TEST(RemoveFloaters, ScenesAreNeverDropped) {
  GaussianCloud one;
  add_ball(one, {5.0f, 5.0f, 5.0f}, 0.1f);
  EXPECT_EQ(removed_from(one), 0u);
  GaussianCloud mist = random_cloud(500, 1);  // too thin to be anything else
  for (float& opacity : mist.opacity) opacity = 0.004f;
  for (glm::vec3& scale : mist.scale) scale = glm::vec3(1e-4f);
  EXPECT_EQ(removed_from(mist), 0u);
  GaussianCloud none;
  EXPECT_EQ(removed_from(none), 0u);
}

TEST(RemoveFloaters, ResultsAreTheSameForAnyNumberOfThreads) {
  GaussianCloud one = random_cloud(20'000, 1), three = one;
  EXPECT_EQ(removed_from(one, 1), removed_from(three, 3));
  EXPECT_EQ(ply_bytes(one), ply_bytes(three));
}

}  // namespace
}  // namespace catgs::test
