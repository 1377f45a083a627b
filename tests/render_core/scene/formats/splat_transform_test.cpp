// PlayCanvas's splat-transform as an independent reader of the files that we write, and as an
// independent writer of the files that we read. It needs Node.js, but no GPU.
#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/save_scene.h"
#include "tests/render_core/scene/formats/ksplat_encoder.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/picked.h"
#include "tests/support/run_command.h"

namespace catgs::test {
namespace {

/// Values inside the ranges that all formats hold. View-dependent colours are of few kinds, so that
/// a palette can have all of them.
GaussianCloud storable_cloud(int sh_degree) {
  constexpr std::size_t kinds = 100;
  GaussianCloud cloud = random_cloud(3000, sh_degree);
  const auto stride = static_cast<std::size_t>(cloud.sh_count());
  for (glm::vec3& sh : cloud.sh) sh = glm::clamp(sh, -0.9f, 0.9f);
  for (std::size_t i = kinds; i < cloud.size(); ++i)
    std::copy_n(cloud.sh.begin() + static_cast<std::ptrdiff_t>(i % kinds * stride + 1), stride - 1,
                cloud.sh.begin() + static_cast<std::ptrdiff_t>(i * stride + 1));
  return cloud;
}

/// The Gaussians of `read` in the order of `wanted`, by position: writers may sort them.
GaussianCloud in_order_of(const GaussianCloud& wanted, const GaussianCloud& read) {
  std::vector<std::uint32_t> order;
  std::vector<bool> taken(read.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const auto nearest = std::ranges::min_element(
        read.mean, {}, [&](const glm::vec3& mean) { return glm::distance(mean, wanted.mean[i]); });
    order.push_back(static_cast<std::uint32_t>(nearest - read.mean.begin()));
    EXPECT_FALSE(taken[order.back()]) << "two Gaussians became one";
    taken[order.back()] = true;
  }
  return picked(read, order);
}

// Floats, but for the rounding of logarithms and logits.
constexpr Tolerance floats = {
    .log_scale = 2e-6f, .rotation_rad = 1e-6f, .opacity = 1e-6f, .sh0 = 1e-6f};
// Half a step of bytes, see splat_test.cpp. The rotations' error is twice that: we write bytes
// around 128, as the format's first viewer reads them, and splat-transform reads them around 127.5.
constexpr Tolerance splat_steps = {
    .log_scale = 2e-6f, .rotation_rad = 0.0314f, .opacity = 0.00197f, .sh0 = 0.00697f};
// Our .ksplat has floats, but bytes for colours.
constexpr Tolerance ksplat_steps = {
    .log_scale = 2e-6f, .rotation_rad = 1e-6f, .opacity = 0.00197f, .sh0 = 0.00697f};
// See spz_test.cpp. Theirs has 12 fractional bits, and rounds harmonics twice.
constexpr Tolerance our_spz_steps = {.mean = 0.0000077f,
                                     .log_scale = 0.03126f,
                                     .rotation_rad = smallest_three_angle(0.5f * 0.70711f / 511),
                                     .opacity = 0.00197f,
                                     .sh0 = 0.01308f,
                                     .sh1 = 4.0f / 128 + 1e-6f,
                                     .sh_rest = 8.0f / 128 + 1e-6f};
constexpr Tolerance their_spz_steps = [] {
  Tolerance steps = our_spz_steps;
  steps.mean = 0.000123f;
  steps.sh1 = 4.5f / 128 + 1e-6f;
  steps.sh_rest = 8.5f / 128 + 1e-6f;
  return steps;
}();
// Both writers find codebooks of 256 values, whose steps are widest where values are rare. Theirs
// cuts rotations and opacities off, and does not round them.
constexpr Tolerance our_sog_steps = {.mean = 0.001f,
                                     .log_scale = 0.15f,
                                     .rotation_rad = smallest_three_angle(0.5f * 1.41422f / 255),
                                     .opacity = 0.00197f,
                                     .sh0 = 0.01f,
                                     .sh1 = 0.03f,
                                     .sh_rest = 0.03f};
constexpr Tolerance their_sog_steps = [] {
  Tolerance steps = our_sog_steps;
  steps.rotation_rad = smallest_three_angle(1.41422f / 255);
  steps.opacity = 0.00393f;
  return steps;
}();
// See compressed_ply_test.cpp.
constexpr Tolerance compressed_ply_steps = {
    .mean = 0.0127f,
    .log_scale = 0.0049f,
    .rotation_rad = smallest_three_angle(0.5f * 1.41422f / 1023),
    .opacity = 0.00197f,
    .sh0 = 0.0059f,
    .sh1 = 0.0157f,
    .sh_rest = 0.0157f};

struct Case {
  const char* file;
  int sh_degree;
  Tolerance tolerance;
  const char* options = "";
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.file << " " << c.options; }

class SplatTransform : public FolderTest, public ::testing::WithParamInterface<Case> {
 protected:
  void transform(const std::string& from, const std::string& to) const {
    const std::string command = fmt::format(
        "{} {} --gpu cpu --max-workers 0 --quiet {} {} {}", CATGS_NODE, CATGS_SPLAT_TRANSFORM,
        (folder_ / from).string(), GetParam().options, (folder_ / to).string());
    const Outcome outcome = run_command(command);
    ASSERT_EQ(outcome.exit_code, 0) << command << "\n" << outcome.out;
  }
  void expect_same(const GaussianCloud& wanted, const std::string& file) const {
    const GaussianCloud read = load_scene(folder_ / file).cloud;
    ASSERT_EQ(read.size(), wanted.size());
    expect_near(wanted, in_order_of(wanted, read), GetParam().tolerance);
  }
};

class SplatTransformReads : public SplatTransform {};

TEST_P(SplatTransformReads, WrittenFilesAreRead) {
  const GaussianCloud cloud = storable_cloud(GetParam().sh_degree);
  const std::string file = GetParam().file;
  if (file.ends_with(".ksplat"))
    write(file, encode_ksplat(cloud));  // which the product only reads
  else
    save_scene(cloud, folder_ / file);
  transform(file, "read.ply");
  expect_same(cloud, "read.ply");
}

INSTANTIATE_TEST_SUITE_P(Formats, SplatTransformReads,
                         ::testing::Values(Case{"a.ply", 3, floats},
                                           Case{"a.splat", 0, splat_steps},
                                           Case{"a.spz", 3, our_spz_steps},
                                           Case{"a.sog", 3, our_sog_steps},
                                           Case{"a.ksplat", 2, ksplat_steps}));

class SplatTransformWrites : public SplatTransform {};

TEST_P(SplatTransformWrites, FilesOfTheToolAreRead) {
  const GaussianCloud cloud = storable_cloud(GetParam().sh_degree);
  save_scene(cloud, folder_ / "wanted.ply");
  transform("wanted.ply", GetParam().file);
  expect_same(cloud, GetParam().file);
}

INSTANTIATE_TEST_SUITE_P(Formats, SplatTransformWrites,
                         ::testing::Values(Case{"a.ply", 3, floats},
                                           Case{"a.compressed.ply", 3, compressed_ply_steps},
                                           Case{"a.spz", 3, their_spz_steps, "--spz-version 3"},
                                           Case{"a.spz", 3, their_spz_steps, "--spz-version 4"},
                                           Case{"a.sog", 3, their_sog_steps},
                                           Case{"meta.json", 1, their_sog_steps},
                                           Case{"lod-meta.json", 2, their_sog_steps, "--lod 0"},
                                           Case{"a.glb", 3, floats}));

}  // namespace
}  // namespace catgs::test
