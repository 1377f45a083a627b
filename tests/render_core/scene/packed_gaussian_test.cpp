// What the CUDA core's layout keeps of a scene, on the CPU.

#include "render_core/scene/packed_gaussian.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <gtest/gtest.h>

#include "render_core/math/ellipse-inl.h"
#include "tests/render_core/scene/unpack.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

class PackedScene {
 public:
  explicit PackedScene(const GaussianCloud& cloud)
      : degree_(cloud.sh_degree), order_(cloud.size()) {
    std::iota(order_.begin(), order_.end(), 0u);
    block_.resize(packed_block_bytes(degree_));
    packed_ = pack_cluster(cloud, order_, block_);
  }

  [[nodiscard]] const PackedCluster& packed() const { return packed_; }

  [[nodiscard]] test::Unpacked operator[](std::uint32_t i) const {
    for (int at = 0; at < packed_record_bytes(degree_);) {
      const int width = packed_plane_width(degree_, at);
      EXPECT_EQ(packed_offset(at, width, i) % width, 0u);  // a load of one word
      at += width;
    }
    return test::unpack(block_, packed_.units, degree_, i);
  }

 private:
  int degree_;
  std::vector<std::uint32_t> order_;
  std::vector<std::byte> block_;
  PackedCluster packed_;
};

std::array<double, 6> entries(const math::CovarianceFactor<float>& l) {
  return {l.xx, l.yx, l.yy, l.zx, l.zy, l.zz};
}

std::array<double, 6> exact_entries(const GaussianCloud& cloud, std::uint32_t i) {
  const glm::dquat q = glm::normalize(glm::dquat(cloud.rotation[i]));
  const double rotation[4] = {q.x, q.y, q.z, q.w};
  const glm::dvec3 s(cloud.scale[i]);
  const auto l = math::covariance_factor<double>(rotation, {s.x, s.y, s.z});
  return {l.xx, l.yx, l.yy, l.zx, l.zy, l.zz};
}

/// By Gaussian, the largest harmonic of each degree.
std::vector<std::array<float, max_sh_degree + 1>> largest_sh(const GaussianCloud& cloud) {
  std::vector<std::array<float, max_sh_degree + 1>> largest(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (int k = 1; k < cloud.sh_count(); ++k)
      for (int c = 0; c < 3; ++c) {
        float& of_degree = largest[i][static_cast<std::size_t>(sh_degree_of(k))];
        of_degree = std::max(of_degree, std::abs(cloud.sh_of(i)[k][c]));
      }
  return largest;
}

/// Each value within its bound. That of a harmonic is half a step of its own Gaussian.
void expect_close(const GaussianCloud& cloud) {
  const PackedScene scene(cloud);
  const auto sh_of = largest_sh(cloud);
  std::array<float, max_sh_degree + 1> median{};
  for (std::size_t d = 1; d < median.size(); ++d) {
    std::vector<float> values;
    for (const auto& of_one : sh_of) values.push_back(of_one[d]);
    std::ranges::sort(values);
    median[d] = values[values.size() / 2];
  }
  // No degree's unit is much smaller than the others'.
  const float least = 0.25f * *std::ranges::max_element(median);
  for (std::size_t d = 1; d < median.size(); ++d) median[d] = std::max(median[d], least);
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    const test::Unpacked u = scene[i];
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(u.geometry.mean[axis], cloud.mean[i][axis]);
    const float log2_opacity = std::log2(cloud.opacity[i]);
    EXPECT_NEAR(unpack_log2_opacity(u.geometry.log2_opacity), log2_opacity,
                cloud.sh_degree == 0     ? 6.2e-5
                : log2_opacity > -0.001f ? 1.9e-3
                                         : 1.05e-3);
    const std::uint16_t base[3] = {u.geometry.base_red, u.geometry.base_green,
                                   u.geometry.base_blue};
    for (int c = 0; c < 3; ++c) {
      const float exact = (*cloud.sh_of(i))[c];
      EXPECT_NEAR(from_half(base[c]), exact, 1e-7f + 0x1p-11f * std::abs(exact));
    }
    const auto exact = exact_entries(cloud, i), packed = entries(u.factor);
    const double largest = std::abs(
        *std::ranges::max_element(exact, {}, [](double entry) { return std::abs(entry); }));
    for (std::size_t e = 0; e < 6; ++e)
      EXPECT_NEAR(packed[e], exact[e], 0x1p-13 * largest) << "Gaussian " << i << " entry " << e;
    float times = 0x1p-6f;
    for (std::size_t d = 1; d < median.size(); ++d)
      if (median[d] > 0.0f) times = std::max(times, 2.0f * sh_of[i][d] / median[d]);
    for (int k = 1; k < cloud.sh_count(); ++k)
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(u.sh[3 * (k - 1) + c], cloud.sh_of(i)[k][c],
                    times * median[static_cast<std::size_t>(sh_degree_of(k))] / 253.0f);
  }
}

TEST(PackedGaussian, ValuesAreWithinRoundingInEveryDegree) {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    SCOPED_TRACE(degree);
    for (const std::size_t count : {1, 31, 77, 256})
      expect_close(catgs::test::random_cloud(count, degree, 7 + count));
  }
}

/// The root of the summed squares of the errors of all harmonics but those of one Gaussian.
double sh_error(const GaussianCloud& cloud, std::uint32_t but) {
  const PackedScene scene(cloud);
  double squares = 0.0;
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    if (i == but) continue;
    const test::Unpacked u = scene[i];
    for (std::size_t b = 0; b < u.sh.size(); ++b)
      squares += std::pow(u.sh[b] - cloud.sh_of(i)[1 + b / 3][static_cast<int>(b % 3)], 2);
  }
  return std::sqrt(squares);
}

TEST(PackedGaussian, ExtremeHarmonicsSpoilTheirOwnGaussianAlone) {
  constexpr std::uint32_t wild = 77;
  for (int degree = 1; degree <= max_sh_degree; ++degree)
    for (const float value : {2.0f, 300.0f, -1000.0f}) {
      SCOPED_TRACE(testing::Message() << value << " in degree " << degree);
      GaussianCloud cloud = catgs::test::random_cloud(256, degree, 8);
      const double before = sh_error(cloud, wild);
      for (int k = degree * degree; k < cloud.sh_count(); ++k)
        cloud.sh[wild * static_cast<std::size_t>(cloud.sh_count()) + static_cast<std::size_t>(k)] =
            glm::vec3(value);
      EXPECT_LT(sh_error(cloud, wild), 1.05 * before);
      const float kept = PackedScene(cloud)[wild].sh.back();
      EXPECT_NEAR(kept, value, 0.01f * std::abs(value) + 0.01f);
    }
}

TEST(PackedGaussian, FaintHarmonicsOfManyDoNotClampThoseOfOthers) {
  struct Case {
    float faint, strong;  // in the degrees from the third on
    float below;          // in the first and second degree
    std::uint32_t strong_ones;
  };
  for (const Case& c : {Case{1e-5f, 0.1f, 1e-5f, 115}, Case{1e-4f, 0.4f, 1e-4f, 3},
                        Case{2e-4f, 0.1f, 0.1f, 25}, Case{0.0f, 0.1f, 0.1f, 25}}) {
    SCOPED_TRACE(testing::Message() << c.faint << ", " << c.strong_ones << " of " << c.strong);
    GaussianCloud cloud = catgs::test::random_cloud(256, 3, 8);
    const auto count = static_cast<std::size_t>(cloud.sh_count());
    for (std::size_t i = 0; i < cloud.size(); ++i)
      for (std::size_t k = 1; k < count; ++k)
        cloud.sh[i * count + k] = glm::vec3(i < c.strong_ones ? c.strong
                                            : k < 9           ? c.below
                                                              : c.faint);
    EXPECT_LT(sh_error(cloud, 256) / std::sqrt(256.0 * 45.0), 1e-3);
  }
}

TEST(PackedGaussian, FaintOnesStayFaint) {
  for (const int degree : {0, 3}) {
    GaussianCloud cloud = catgs::test::random_cloud(4, degree, 6);
    cloud.opacity = {1e-38f, 0.0039f, 0.00393f, 0.99999f};  // 1/255 is between the middle ones
    const PackedScene scene(cloud);
    const auto reach = [&](std::uint32_t i) {
      return math::reach_of(unpack_log2_opacity(scene[i].geometry.log2_opacity));
    };
    EXPECT_LT(reach(0), 0.0f);
    EXPECT_LT(reach(1), 0.0f);
    EXPECT_GT(reach(2), 0.0f);
    EXPECT_NEAR(reach(3), 7.994f, 2e-3f);
  }
}

TEST(PackedGaussian, GaussiansTakeAtMost80Bytes) {
  const auto bytes = [](int degree) {
    return static_cast<double>(packed_block_bytes(degree) + sizeof(PackedUnits) + sizeof(Cluster)) /
           static_cast<double>(cluster_size);
  };
  EXPECT_LE(bytes(3), 80.0);
  EXPECT_LE(bytes(0), 33.0);
}

TEST(PackedGaussian, PlanesCoverTheBlockOnce) {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    std::vector<int> covered(packed_block_bytes(degree));
    for (int at = 0; at < packed_record_bytes(degree);) {
      const int width = packed_plane_width(degree, at);
      for (std::uint32_t i = 0; i < cluster_size; ++i)
        for (int b = 0; b < width; ++b) ++covered[packed_offset(at, width, i) + b];
      at += width;
    }
    EXPECT_EQ(std::ranges::count(covered, 1), static_cast<std::ptrdiff_t>(covered.size()));
  }
}

// A grain beside a mountain keeps its shape, and so do clusters that are all tiny.
TEST(PackedGaussian, ShapesOfAllSizesAreKept) {
  GaussianCloud cloud = catgs::test::random_cloud(256, 0, 1);
  for (const float largest : {1.0f, 1e6f}) {
    SCOPED_TRACE(largest);
    for (std::size_t i = 0; i < cloud.size(); ++i)
      cloud.scale[i] = glm::vec3(largest) * std::pow(10.0f, -static_cast<float>(i % 16));
    expect_close(cloud);
  }
  for (glm::vec3& scale : cloud.scale) scale = glm::vec3(1e-12f);
  expect_close(cloud);
}

// The ends of a needle 100000 times as long as thick stay where they are: within 2^-13 of its
// length.
TEST(PackedGaussian, NeedlesKeepTheirDirection) {
  GaussianCloud cloud = catgs::test::random_cloud(256, 0, 2);
  for (glm::vec3& scale : cloud.scale) scale = {1.0f, 1e-5f, 1e-5f};
  const PackedScene scene(cloud);
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    const glm::dvec3 axis = glm::dmat3(glm::mat3_cast(glm::dquat(cloud.rotation[i])))[0];
    const auto l = scene[i].factor;
    // Sigma = L L^T: its longest axis is Sigma applied to about the axis.
    const glm::dvec3 lt(l.xx * axis.x + l.yx * axis.y + l.zx * axis.z,
                        l.yy * axis.y + l.zy * axis.z, l.zz * axis.z);
    const glm::dvec3 end(l.xx * lt.x, l.yx * lt.x + l.yy * lt.y,
                         l.zx * lt.x + l.zy * lt.y + l.zz * lt.z);
    EXPECT_NEAR(glm::length(end), 1.0, 1e-3);
    EXPECT_LT(glm::length(glm::cross(glm::normalize(end), axis)), 0x1p-13);
  }
}

TEST(PackedGaussian, HarmonicsOfOneColourNeedNoRange) {
  GaussianCloud cloud = catgs::test::random_cloud(40, 3, 3);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (int k = 1; k < cloud.sh_count(); ++k) cloud.sh[i * 16 + k] = glm::vec3(0.0f);
  const PackedScene scene(cloud);
  for (std::uint32_t i = 0; i < cloud.size(); ++i)
    for (const float value : scene[i].sh) EXPECT_EQ(value, 0.0f);
}

// Rounding must not shift a scene's colour: errors cancel.
TEST(PackedGaussian, HarmonicsAreRoundedWithoutBias) {
  const GaussianCloud cloud = catgs::test::random_cloud(256, 3, 4);
  const PackedScene scene(cloud);
  double error = 0.0, magnitude = 0.0;
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    const test::Unpacked u = scene[i];
    for (int b = 0; b < 45; ++b) {
      const double e = u.sh[b] - cloud.sh_of(i)[1 + b / 3][b % 3];
      error += e;
      magnitude += std::abs(e);
    }
  }
  EXPECT_GT(magnitude, 0.0);
  EXPECT_LT(std::abs(error), 0.03 * magnitude);
}

// Clusters are culled by bounds that hold for what is drawn.
TEST(PackedGaussian, BoundsHoldForWhatIsPacked) {
  GaussianCloud cloud = catgs::test::random_cloud(256, 0, 5);
  for (glm::vec3& scale : cloud.scale) scale.y = 1e-4f * scale.x;
  const PackedScene scene(cloud);
  const Cluster& bounds = scene.packed().bounds;
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    const test::Unpacked u = scene[i];
    double variance = 0.0;
    for (const double entry : entries(u.factor)) variance += entry * entry;
    const double visible = 255.0 * std::exp2(unpack_log2_opacity(u.geometry.log2_opacity));
    EXPECT_GE(bounds.reach * (1.0 + 1e-6),
              std::sqrt(2.0 * std::log(std::max(1.0, visible)) * variance));
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_LE(std::abs(cloud.mean[i][axis] - bounds.centre[axis]), bounds.half_extent[axis]);
  }
}

// Needles, flakes and balls. The factor of a flake that a world axis crosses at right angles is not
// unique within rounding, its covariance is.
TEST(PackedGaussian, RecordsAreUnpackedToTheirGaussians) {
  for (const int degree : {0, 3}) {
    SCOPED_TRACE(degree);
    GaussianCloud cloud = catgs::test::random_cloud(200, degree, 12);
    for (std::size_t i = 0; i < cloud.size(); ++i)
      cloud.scale[i] *= glm::vec3(1.0f, i % 2 ? 1e-4f : 1.0f, i % 3 ? 1e-3f : 1.0f);
    std::vector<std::uint32_t> all(cloud.size());
    std::iota(all.begin(), all.end(), 0u);
    std::vector<std::byte> block(packed_block_bytes(degree));
    const PackedCluster packed = pack_cluster(cloud, all, block);

    GaussianCloud read;
    read.resize(cloud.size(), degree);
    std::vector<math::CovarianceFactor<double>> factors(cloud.size());
    unpack_cluster(block, packed.units, cloud.size(), read, 0, factors);
    for (std::uint32_t i = 0; i < cloud.size(); ++i) {
      const test::Unpacked u = test::unpack(block, packed.units, degree, i);
      EXPECT_EQ(read.mean[i], cloud.mean[i]);
      EXPECT_EQ(read.opacity[i], std::exp2(unpack_log2_opacity(u.geometry.log2_opacity)));
      EXPECT_EQ(read.sh_of(i)->g, from_half(u.geometry.base_green));
      for (int k = 3; k < 3 * read.sh_count(); ++k)
        EXPECT_EQ(read.sh_of(i)[k / 3][k % 3], u.sh[static_cast<std::size_t>(k - 3)]);
      EXPECT_EQ(factors[i].zx, u.factor.zx);

      const auto [rotation, scale] = axes_of(factors[i]);
      EXPECT_NEAR(glm::length(rotation), 1.0f, 1e-6f);
      const auto& l = factors[i];
      const glm::dmat3 root(l.xx, l.yx, l.zx, 0, l.yy, l.zy, 0, 0, l.zz);
      const glm::dmat3 axes(glm::mat3_cast(rotation));
      const glm::dmat3 scaled(axes[0] * double{scale.x}, axes[1] * double{scale.y},
                              axes[2] * double{scale.z});
      const glm::dmat3 difference = scaled * glm::transpose(scaled) - root * glm::transpose(root);
      const double largest = std::pow(std::max({scale.x, scale.y, scale.z}), 2.0);
      for (int c = 0; c < 3; ++c)
        EXPECT_LT(glm::length(difference[c]), 2e-6 * largest) << "Gaussian " << i;
    }
  }
}

TEST(PackedGaussian, AxesOfFlatFactorsAreAxes) {
  for (const math::CovarianceFactor<double>& l : {math::CovarianceFactor<double>{0, 0, 0, 0, 0, 0},
                                                  {2, 0, 0, 0, 0, 0},
                                                  {0, 0, 3, 0, 0, 0},
                                                  {1, 1, 0, 1, 0, 0},
                                                  {0, 0, 0, 0, 0, 1e-12}}) {
    const auto [rotation, scale] = axes_of(l);
    EXPECT_NEAR(glm::length(rotation), 1.0f, 1e-6f);
    EXPECT_NEAR(glm::length(glm::dvec3(scale)),
                std::sqrt(l.xx * l.xx + l.yx * l.yx + l.yy * l.yy + l.zx * l.zx + l.zz * l.zz),
                1e-6);
  }
}

}  // namespace
}  // namespace catgs
