#include "render_core/scene/tree/merge_nodes.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "render_core/reference/reference.h"
#include "tests/support/picked.h"
#include "tests/support/rendered.h"
#include "tests/support/surface_clouds.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

struct Node {
  NodeFacts facts;
  std::vector<std::byte> block;

  [[nodiscard]] NodeView view() const { return {facts, block}; }
};

Node leaf(const GaussianCloud& cloud, std::size_t first, std::size_t count) {
  Node node{{}, std::vector<std::byte>(packed_block_bytes(cloud.sh_degree))};
  std::vector<std::uint32_t> members(count);
  std::iota(members.begin(), members.end(), static_cast<std::uint32_t>(first));
  const PackedCluster packed = pack_cluster(cloud, members, node.block);
  node.facts = {packed.units, packed.bounds, 0.0f, static_cast<std::uint32_t>(count), {}};
  return node;
}

Node merged(const Node& a, const Node& b, int degree) {
  Node node{{}, std::vector<std::byte>(packed_block_bytes(degree))};
  const NodeView children[] = {a.view(), b.view()};
  node.facts = merge_nodes(children, degree, node.block);
  return node;
}

GaussianCloud gaussians_of(std::span<const Node> nodes, int degree) {
  GaussianCloud cloud;
  for (const Node& node : nodes) {
    const std::size_t first = cloud.size();
    cloud.resize(first + node.facts.count, degree);
    std::vector<math::CovarianceFactor<double>> factors(node.facts.count);
    unpack_cluster(node.block, node.facts.units, node.facts.count, cloud, first, factors);
    for (std::size_t i = 0; i < factors.size(); ++i) {
      const GaussianAxes axes = axes_of(factors[i]);
      cloud.rotation[first + i] = axes.rotation;
      cloud.scale[first + i] = glm::max(axes.scale, 1e-10f);
    }
  }
  return cloud;
}

constexpr float focal_px = 200.0f;

/// Nodes in an image of 64x64 px, drawn by the oracle before a background, so far from a box that
/// the distance to it is `distance`.
std::vector<float> draw(std::span<const Node> nodes, int degree, const Cluster& bounds,
                        float distance, const glm::vec3& background) {
  const auto renderer =
      make_reference_renderer(std::make_shared<const GaussianCloud>(gaussians_of(nodes, degree)),
                              std::make_shared<ThreadPool>(2));
  const auto view = renderer->make_view({});
  const glm::vec3 from =
      bounds.centre - glm::vec3(0.3f, 0.2f, 1.0f) * (distance + glm::length(bounds.half_extent));
  return test::render_in(*view, {.camera = make_camera(test::look_at(from, bounds.centre), {64, 64},
                                                       focal_px, 1e-3f),
                                 .background = background})
      .rgb;
}

/// PSNR of a node against others, both drawn from where the node's error is `error_px`. What is
/// behind has another colour than any Gaussian.
double psnr_from_error(const Node& node, std::span<const Node> others, int degree, float error_px) {
  const float distance = node.facts.error * focal_px / error_px;
  const auto from_there = [&](std::span<const Node> nodes) {
    return draw(nodes, degree, node.facts.bounds, distance, {0.1f, 0.9f, 0.2f});
  };
  return test::psnr_db(from_there(std::span(&node, 1)), from_there(others));
}

/// A wall with a pattern, in the order of the curve: what captures consist of.
GaussianCloud wall(std::size_t count) {
  ThreadPool pool(1);
  GaussianCloud random = test::random_cloud(count, 1, 11);
  for (std::size_t i = 0; i < count; ++i) {
    glm::vec3& mean = random.mean[i];
    mean.z = 5.0f + 0.002f * mean.z;
    random.scale[i] = glm::vec3(0.06f, 0.06f, 0.004f);
    random.rotation[i] = glm::quat(1, 0, 0, 0);
    random.opacity[i] = 0.3f + 0.6f * random.opacity[i];
    random.sh[i * 4] = glm::vec3(std::sin(3.0f * mean.x), std::cos(2.0f * mean.y), 0.3f);
  }
  return test::picked(random, morton_order(random.mean, pool));
}

TEST(MergeNodes, NodesLookLikeTheirChildrenFromTheirErrorsDistance) {
  const GaussianCloud cloud = wall(1024);
  const Node leaves[] = {leaf(cloud, 0, 256), leaf(cloud, 256, 256), leaf(cloud, 512, 256),
                         leaf(cloud, 768, 256)};
  const Node a = merged(leaves[0], leaves[1], 1), b = merged(leaves[2], leaves[3], 1);
  const Node top = merged(a, b, 1);
  EXPECT_EQ(top.facts.count, 256u);
  // Measured: 34 and 36 dB at half a pixel, 42 dB at a quarter, before a background in full
  // contrast.
  for (const auto& [error_px, least_db] : {std::pair(0.5f, 33.0), {0.25f, 40.0}}) {
    EXPECT_GT(psnr_from_error(a, std::span(leaves).first(2), 1, error_px), least_db);
    EXPECT_GT(psnr_from_error(top, leaves, 1, error_px), least_db);
  }
  // From too near, the difference shows.
  EXPECT_LT(psnr_from_error(top, leaves, 1, 4.0f), 30.0);
}

TEST(MergeNodes, CoincidentGaussiansBecomeOneThatHidesAsMuch) {
  GaussianCloud cloud = test::random_cloud(256, 0, 2);
  std::vector<std::uint32_t> twice(512);
  for (std::uint32_t i = 0; i < 512; ++i) twice[i] = i % 256;
  cloud = test::picked(cloud, twice);
  for (float& opacity : cloud.opacity) opacity = 0.3f;
  const Node node = merged(leaf(cloud, 0, 256), leaf(cloud, 256, 256), 0);
  ASSERT_EQ(node.facts.count, 256u);
  EXPECT_LT(node.facts.error, 1e-6f);
  const GaussianCloud out = gaussians_of(std::span(&node, 1), 0);
  for (std::size_t i = 0; i < 256; ++i) {
    EXPECT_EQ(out.mean[i], cloud.mean[i]);
    EXPECT_NEAR(out.opacity[i], 0.6f, 1e-3f);
  }
}

TEST(MergeNodes, MomentsAndProjectedAreaAreKept) {
  // 255 lonely Gaussians in each child, and one pair that is worth joining.
  GaussianCloud cloud = test::random_cloud(257, 0, 5);
  for (std::size_t i = 0; i < 257; ++i) cloud.mean[i] = glm::vec3(100.0f * static_cast<float>(i));
  for (const std::size_t i : {0, 256}) {
    cloud.rotation[i] = glm::quat(1, 0, 0, 0);
    cloud.scale[i] = glm::vec3(1, 2, 0.5f);
    cloud.mean[i] = glm::vec3(i == 0 ? -0.5f : 0.5f, 0, 0);
    cloud.opacity[i] = i == 0 ? 0.2f : 0.6f;
    cloud.sh[i] = glm::vec3(i == 0 ? 1.0f : 0.0f);
  }
  const Node node = merged(leaf(cloud, 0, 256), leaf(cloud, 256, 1), 0);
  ASSERT_EQ(node.facts.count, 256u);
  const GaussianCloud out = gaussians_of(std::span(&node, 1), 0);
  EXPECT_NEAR(out.mean[0].x, 0.25f, 1e-3f);  // weights 1 : 3
  EXPECT_NEAR(out.sh[0].g, 0.25f, 1e-3f);
  const double xx = 1.0 + 0.75 * 0.25, yy = 4.0, zz = 0.25;  // the means' variance is added
  const glm::vec3 s = out.scale[0];
  EXPECT_NEAR(s.x * s.x + s.y * s.y + s.z * s.z, xx + yy + zz, 2e-3);
  const double area = std::sqrt(xx * yy + xx * zz + yy * zz), before = std::sqrt(4 + 0.25 + 1.0);
  EXPECT_NEAR(out.opacity[0], 0.8 * before / area, 1e-3);
  EXPECT_EQ(out.mean[1], cloud.mean[1]);  // alone
  EXPECT_EQ(node.facts.error, 0.0f);      // of 0.9 of its Gaussians
}

// A wall as captures have it: opaque, in layers that hide each other.
TEST(MergeNodes, ClosedSurfacesStayClosedThroughLevels) {
  GaussianCloud cloud = wall(16 * 256);
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud.opacity[i] = 0.7f + 0.29f * cloud.opacity[i];
  std::vector<Node> leaves;
  for (std::size_t first = 0; first < cloud.size(); first += 256)
    leaves.push_back(leaf(cloud, first, 256));
  std::vector<Node> level = leaves;
  for (int l = 1; l <= 4; ++l) {
    std::vector<Node> above;
    for (std::size_t i = 0; i + 1 < level.size(); i += 2)
      above.push_back(merged(level[i], level[i + 1], 1));
    level = std::move(above);
    const Cluster& bounds = level[0].facts.bounds;
    const auto leak = [&](std::span<const Node> nodes) {
      const auto before = [&](float grey) { return draw(nodes, 1, bounds, 0.5f, glm::vec3(grey)); };
      const std::vector<float> dark = before(0.0f), bright = before(1.0f);
      double sum = 0.0;
      for (std::size_t i = 0; i < dark.size(); ++i) sum += double{bright[i]} - double{dark[i]};
      return sum / static_cast<double>(dark.size());
    };
    const auto under = std::span(leaves).first(leaves.size() / level.size());
    EXPECT_LT(leak(std::span(level).first(1)), leak(under) + 0.06) << "level " << l;
  }
}

// Such a Gaussian does not decide how the others are grouped.
TEST(MergeNodes, AHugeOrFarGaussianCostsTheOthersNothing) {
  const GaussianCloud cloud = wall(512);
  const auto error_of = [](const GaussianCloud& of) {
    return merged(leaf(of, 0, 256), leaf(of, 256, 256), 1).facts.error;
  };
  GaussianCloud huge = cloud, far = cloud;
  huge.scale[100] = glm::vec3(1e4f);
  far.mean[100] = glm::vec3(1e6f);
  EXPECT_LT(error_of(huge), 1.1f * error_of(cloud));
  EXPECT_LT(error_of(far), 1.1f * error_of(cloud));
}

TEST(MergeNodes, BoundsAndErrorsHoldThoseOfTheChildren) {
  const GaussianCloud cloud = test::random_cloud(1000, 3, 6);
  const Node leaves[] = {leaf(cloud, 0, 256), leaf(cloud, 256, 256), leaf(cloud, 512, 256),
                         leaf(cloud, 768, 232)};
  const Node a = merged(leaves[0], leaves[1], 3), b = merged(leaves[2], leaves[3], 3);
  const Node top = merged(a, b, 3);
  for (const auto& [parent, child] :
       {std::pair(&a, &leaves[0]), {&a, &leaves[1]}, {&b, &leaves[3]}, {&top, &a}, {&top, &b}}) {
    const Cluster &p = parent->facts.bounds, &c = child->facts.bounds;
    EXPECT_GE(parent->facts.error, child->facts.error);
    EXPECT_GE(p.reach, c.reach);
    for (int axis = 0; axis < 3; ++axis) {
      const double off = double{c.centre[axis]} - double{p.centre[axis]};
      EXPECT_LE(std::abs(off) + double{c.half_extent[axis]}, double{p.half_extent[axis]});
    }
  }
  EXPECT_GT(a.facts.error, 0.0f);
  EXPECT_GT(top.facts.error, std::max(a.facts.error, b.facts.error));
}

TEST(MergeNodes, NodesThatFitOneClusterKeepTheirGaussians) {
  const GaussianCloud cloud = test::random_cloud(200, 0, 7);
  const Node a = leaf(cloud, 0, 150), b = leaf(cloud, 150, 50);
  const Node node = merged(a, b, 0);
  EXPECT_EQ(node.facts.count, 200u);
  EXPECT_EQ(node.facts.error, 0.0f);
  const NodeView only[] = {a.view()};
  std::vector<std::byte> copy(a.block.size());
  EXPECT_EQ(merge_nodes(only, 0, copy).count, 150u);
  EXPECT_EQ(copy, a.block);
}

}  // namespace
}  // namespace catgs
