#include "render_core/scene/tree/gaussian_sorter.h"

#include <algorithm>
#include <limits>

#include <glm/common.hpp>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

/// All of a cloud, sorted in so much memory and read `step` at a time.
GaussianCloud sorted(const GaussianCloud& cloud, std::size_t memory_bytes, std::size_t step) {
  ThreadPool pool(2);
  const test::TemporaryFolder folder;
  glm::vec3 low = cloud.mean[0], high = low;
  for (const glm::vec3& mean : cloud.mean) {
    low = glm::min(low, mean);
    high = glm::max(high, mean);
  }
  GaussianSorter sorter(MortonCurve(low, high), cloud.size(), cloud.sh_degree, memory_bytes,
                        folder / "sort", pool);
  sorter.add(cloud);
  sorter.finish();
  GaussianCloud all, some;
  all.resize(0, cloud.sh_degree);
  do {
    sorter.next(step, some);
    all.mean.insert(all.mean.end(), some.mean.begin(), some.mean.end());
    all.rotation.insert(all.rotation.end(), some.rotation.begin(), some.rotation.end());
    all.scale.insert(all.scale.end(), some.scale.begin(), some.scale.end());
    all.opacity.insert(all.opacity.end(), some.opacity.begin(), some.opacity.end());
    all.sh.insert(all.sh.end(), some.sh.begin(), some.sh.end());
  } while (!some.empty());
  return all;
}

void expect_morton_order(const GaussianCloud& cloud, std::size_t memory_bytes, std::size_t step) {
  ThreadPool pool(2);
  const GaussianCloud all = sorted(cloud, memory_bytes, step);
  const auto order = morton_order(cloud.mean, pool);
  ASSERT_EQ(all.size(), cloud.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    ASSERT_EQ(all.mean[i], cloud.mean[order[i]]);
    ASSERT_EQ(all.rotation[i], cloud.rotation[order[i]]);
    ASSERT_EQ(all.scale[i], cloud.scale[order[i]]);
    ASSERT_EQ(all.opacity[i], cloud.opacity[order[i]]);
    ASSERT_TRUE(std::equal(all.sh_of(i), all.sh_of(i) + all.sh_count(), cloud.sh_of(order[i])));
  }
}

TEST(GaussianSorter, OrderIsThatOfMortonOrderInMemoryAndOnDisk) {
  const GaussianCloud cloud = test::random_cloud(30'000, 1, 3);
  expect_morton_order(cloud, std::size_t{1} << 30, 7'777);
  expect_morton_order(cloud, 0, 7'777);  // 8 runs
  expect_morton_order(cloud, 3'000'000, 1);
}

TEST(GaussianSorter, EqualPlacesKeepTheirOrderOverRuns) {
  GaussianCloud cloud = test::random_cloud(10'000, 0, 4);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    cloud.mean[i] = glm::vec3(static_cast<float>(i % 3));
  expect_morton_order(cloud, 0, 1000);
}

TEST(GaussianSorter, UnwritableFoldersAreNamed) {
  ThreadPool pool(1);
  GaussianSorter sorter(MortonCurve(glm::vec3(0), glm::vec3(1)), 5000, 0, 0, "/nowhere/at/all",
                        pool);
  EXPECT_THROW(sorter.add(test::random_cloud(5000, 0, 1)), InputError);
}

}  // namespace
}  // namespace catgs
