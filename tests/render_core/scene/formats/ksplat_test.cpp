#include "render_core/scene/formats/ksplat.h"

#include <cstring>

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/scene_size.h"
#include "tests/render_core/scene/formats/ksplat_encoder.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using ::testing::HasSubstr;

GaussianCloud parse(const std::string& bytes) {
  return read_ksplat(MemorySource("scene.ksplat", bytes_of(bytes)), two_threads());
}

struct Case {
  int level, sh_degree;
};

class KsplatLevels : public ::testing::TestWithParam<Case> {};

TEST_P(KsplatLevels, AreRead) {
  const auto [level, degree] = GetParam();
  const GaussianCloud cloud = random_cloud(5001, degree);
  // Half floats have 11 bits; colours and opacities are bytes at every level.
  const float half = 1.0f / 2048;
  const float sh = level == 0 ? 0.0f : level == 1 ? half : 0.5f * 3.0f / 255 + 1e-6f;
  const Tolerance tolerance = {.mean = level == 0 ? 0.0f : 32.0f / 32767,
                               .log_scale = level == 0 ? 0.0f : half,
                               .rotation_rad = level == 0 ? 1e-6f : 4 * half,
                               .opacity = 0.00197f,
                               .sh0 = 0.00697f,
                               .sh1 = sh,
                               .sh_rest = sh};
  expect_near(cloud, parse(encode_ksplat(cloud, {.level = level})), tolerance);
}

INSTANTIATE_TEST_SUITE_P(Ksplat, KsplatLevels,
                         ::testing::Values(Case{0, 0}, Case{0, 1}, Case{0, 2}, Case{1, 0},
                                           Case{1, 1}, Case{1, 2}, Case{2, 0}, Case{2, 1},
                                           Case{2, 2}));

class KsplatFiles : public FolderTest {};

TEST_F(KsplatFiles, AreKnownByTheirName) {
  const auto path = write("room.ksplat", encode_ksplat(random_cloud(300, 1), {.level = 1}));
  const Scene scene = load_scene(path);
  EXPECT_EQ(scene.format, "ksplat");
  EXPECT_EQ(scene.cloud.size(), 300u);
  EXPECT_EQ(read_scene_size(locate_scene(path)).gaussians, 300u);
  EXPECT_EQ(read_scene_size(locate_scene(path)).sh_degree, 1);
}

/// The error of a file of three sections with another number at a byte.
template <class T>
std::string error_with(std::size_t at, T value, int level = 1) {
  std::string bytes = encode_ksplat(random_cloud(300, 1), {.level = level});
  std::memcpy(bytes.data() + at, &value, sizeof value);
  return input_error([&] { parse(bytes); });
}

TEST(Ksplat, LyingHeadersAreRefused) {
  constexpr auto far = std::uint32_t{0xffffffff};
  constexpr std::size_t section = 4096;
  EXPECT_THAT(error_with(0, std::uint8_t{1}), HasSubstr("scene.ksplat: byte 0: version 1.1"));
  EXPECT_THAT(error_with(1, std::uint8_t{0}), HasSubstr("version 0.0"));
  EXPECT_THAT(error_with(4, far), HasSubstr("maxSectionCount"));
  EXPECT_THAT(error_with(16, std::uint32_t{299}),
              HasSubstr("splatCount: 299, and its sections have 300"));
  EXPECT_THAT(error_with(20, std::uint16_t{3}), HasSubstr("compressionLevel: 3"));
  EXPECT_THAT(error_with(section, std::uint32_t{154}),
              HasSubstr("section 0: 154 Gaussians in 153"));
  EXPECT_THAT(error_with(section + 4, far), HasSubstr("section 0: ends at byte"));
  EXPECT_THAT(error_with(section + 8, std::uint32_t{15}), HasSubstr("buckets: 141 of 150"));
  EXPECT_THAT(error_with(section + 12, far), HasSubstr("section 0: ends at byte"));
  EXPECT_THAT(error_with(section + 12, std::uint32_t{10}), HasSubstr("more buckets in use"));
  EXPECT_THAT(error_with(section + 20, std::uint16_t{11}), HasSubstr("for a bucket's centre"));
  EXPECT_THAT(error_with(section + 32, far), HasSubstr("more buckets in use"));
  EXPECT_THAT(error_with(section + 36, far), HasSubstr("section 0: ends at byte"));
  EXPECT_THAT(error_with(section + 40, std::uint16_t{3}), HasSubstr("SH degree 3"));
}

TEST(Ksplat, CutOffFilesAreRefused) {
  const std::string whole = encode_ksplat(random_cloud(300, 0), {.level = 2});
  for (const std::size_t length : {0, 43, 4000, 4096, 6000, 7168, 10'000})
    EXPECT_THAT(input_error([&] { parse(whole.substr(0, length)); }), HasSubstr("scene.ksplat"))
        << length;
}

}  // namespace
}  // namespace catgs::test
