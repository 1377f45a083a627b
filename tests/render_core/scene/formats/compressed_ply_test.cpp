#include "render_core/scene/formats/compressed_ply.h"

#include <fmt/format.h>

#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

GaussianCloud parse(const std::string& bytes) {
  const MemorySource file("scene.ply", bytes_of(bytes));
  const PlyHeader header = read_ply_header(file);
  EXPECT_TRUE(is_compressed_ply(header));
  return read_compressed_ply(file, header, two_threads());
}

std::string replaced(std::string bytes, const std::string& from, const std::string& to) {
  return bytes.replace(bytes.find(from), from.size(), to);
}

TEST(CompressedPly, CompressedFilesAreRead) {
  // Half a step of what chunks of means within ±13, log scales within -4 ± 5 and constant SH
  // within ±1.5 can span; the sh bytes have steps of 1/32 and stand for their middles.
  Tolerance tolerance = {.mean = 0.0127f,
                         .log_scale = 0.0049f,
                         .rotation_rad = smallest_three_angle(0.5f * 1.41422f / 1023),
                         .opacity = 0.00197f,
                         .sh0 = 0.0059f,
                         .sh1 = 0.0157f,
                         .sh_rest = 0.0157f};
  for (const int degree : {0, 1, 2, 3}) {
    const GaussianCloud cloud = random_cloud(10000, degree);  // the last chunk is not full
    expect_near(cloud, parse(encode_compressed_ply(cloud, true)), tolerance);
  }
  GaussianCloud cloud = random_cloud(10000, 0);
  for (glm::vec3& sh : cloud.sh) sh = glm::clamp(sh, -1.77f, 1.77f);  // colours in [0, 1]
  tolerance.sh0 = 0.00696f;
  expect_near(cloud, parse(encode_compressed_ply(cloud, false)), tolerance);
}

TEST(CompressedPlyErrors, ErrorsNameElementAndProperty) {
  std::string bytes = encode_compressed_ply(random_cloud(300, 1), true);
  struct Change {
    const char *from, *to, *where;
  };
  for (const Change& change : std::vector<Change>{
           {"float min_scale_y", "float min_scale_q", "element chunk property min_scale_y"},
           {"uint packed_scale", "float packed_scale", "element vertex property packed_scale"},
           {"chunk 2", "chunk 1", "element chunk"},
           {"sh 300", "sh 299", "element sh"},
           {"little", "big", "header"},
           {"vertex 300", "vertex 18446744073709551615", "element vertex"},
       })
    EXPECT_EQ(refusal_of([&] { parse(replaced(bytes, change.from, change.to)); }),
              (Refusal{"scene.ply", change.where}));
  bytes = replaced(bytes, "vertex 300", "vertex 400");
  EXPECT_EQ(refusal_of([&] { parse(bytes); }),
            (Refusal{"scene.ply", fmt::format("byte {}", bytes.size())}));
}

TEST(CompressedPlyErrors, CutOffFilesAreRefusedAtEveryLength) {
  const std::string bytes = encode_compressed_ply(random_cloud(20, 1), true);
  for (std::size_t length = bytes.find("end_header") + 11; length < bytes.size(); ++length)
    EXPECT_EQ(refusal_of([&] { parse(bytes.substr(0, length)); }).source, "scene.ply")
        << "cut at byte " << length;
}

}  // namespace
}  // namespace catgs::test
