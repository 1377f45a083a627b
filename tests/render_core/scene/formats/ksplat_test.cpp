#include "render_core/scene/formats/ksplat.h"

#include <cstring>
#include <vector>

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/scene_size.h"
#include "tests/render_core/scene/formats/ksplat_encoder.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

GaussianCloud parse(const std::string& bytes) {
  return read_ksplat(MemorySource("scene.ksplat", bytes_of(bytes)), two_threads());
}

void expect_to_be_read(int level, int degree) {
  SCOPED_TRACE(testing::Message() << "level " << level << ", degree " << degree);
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

TEST(Ksplat, AllLevelsAreRead) {
  for (const int level : {0, 1, 2})
    for (const int degree : {0, 1, 2}) expect_to_be_read(level, degree);
}

class KsplatFiles : public FolderTest {};

TEST_F(KsplatFiles, FilesAreKnownByName) {
  const auto path = write("room.ksplat", encode_ksplat(random_cloud(300, 1), {.level = 1}));
  const Scene scene = load_scene(path);
  EXPECT_EQ(scene.format, "ksplat");
  EXPECT_EQ(scene.cloud.size(), 300u);
  EXPECT_EQ(read_scene_size(locate_scene(path)).gaussians, 300u);
  EXPECT_EQ(read_scene_size(locate_scene(path)).sh_degree, 1);
}

TEST(Ksplat, LyingHeadersAreRefused) {
  constexpr auto far = std::uint32_t{0xffffffff};
  constexpr std::size_t section = 4096;
  struct Lie {
    std::size_t at, bytes;
    std::uint32_t value;
    const char* where;
  };
  for (const auto& [at, size, value, where] : std::vector<Lie>{
           {0, 1, 1, "byte 0"},
           {1, 1, 0, "byte 0"},
           {4, 4, far, "maxSectionCount"},
           {16, 4, 299, "splatCount"},
           {20, 2, 3, "compressionLevel"},
           {section, 4, 154, "section 0"},
           {section + 4, 4, far, "section 0"},
           {section + 8, 4, 15, "buckets"},
           {section + 12, 4, far, "section 0"},
           {section + 12, 4, 10, "section 0"},
           {section + 20, 2, 11, "section 0"},
           {section + 32, 4, far, "section 0"},
           {section + 36, 4, far, "section 0"},
           {section + 40, 2, 3, "section 0"},
       }) {
    std::string bytes = encode_ksplat(random_cloud(300, 1), {.level = 1});
    std::memcpy(bytes.data() + at, &value, size);
    EXPECT_EQ(refusal_of([&] { parse(bytes); }), (Refusal{"scene.ksplat", where})) << at;
  }
}

TEST(Ksplat, CutOffFilesAreRefused) {
  const std::string whole = encode_ksplat(random_cloud(300, 0), {.level = 2});
  for (const std::size_t length : {0, 43, 4000, 4096, 6000, 7168, 10'000})
    EXPECT_EQ(refusal_of([&] { parse(whole.substr(0, length)); }).source, "scene.ksplat") << length;
}

}  // namespace
}  // namespace catgs::test
