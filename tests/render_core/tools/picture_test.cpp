// JPEG against libjpeg: data/photo.png is data/photo.jpg (4:2:0) as libjpeg-turbo decodes it.
#include "render_core/tools/picture.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "render_core/image/png.h"
#include "render_core/metrics/image_quality.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

const std::filesystem::path photo = CATGS_TOOLS_DATA "/photo.jpg";

class Jpeg : public ::testing::Test {
 protected:
  void SetUp() override {
    try {
      (void)read_jpeg(photo);
    } catch (const InputError& error) {
      if (std::string_view(error.what()).find("without TurboJPEG") != std::string_view::npos)
        GTEST_SKIP() << error.what();
      throw;
    }
  }
  const test::TemporaryFolder folder_;
};

TEST_F(Jpeg, IsReadAsLibjpegReadsIt) {
  const Image image = read_picture(photo);
  const Image expected = read_png(CATGS_TOOLS_DATA "/photo.png");
  ASSERT_EQ(image.size_px, expected.size_px);
  const ImageQuality quality = compare_images(image, expected);
  EXPECT_LE(quality.max_error, 1.0 / 255.0);  // rounding may differ with the processor
}

TEST_F(Jpeg, TheContentTellsTheKind) {
  std::filesystem::copy_file(photo, folder_ / "photo.png");
  EXPECT_EQ(read_picture(folder_ / "photo.png").size_px, glm::ivec2(48, 32));
  EXPECT_TRUE(is_picture("a/b.JPG"));
  EXPECT_FALSE(is_picture("a/b.gif"));
}

TEST_F(Jpeg, DamageIsAnError) {
  std::ifstream file(photo, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(file), {}};
  for (const std::string& bytes :
       {whole.substr(0, whole.size() / 2), whole.substr(0, 40), whole.substr(0, 2),
        whole.substr(0, whole.size() - 2), whole.substr(0, whole.size() / 2) + "\xff\xd9"}) {
    const auto path = folder_.write("damaged.jpg", bytes);
    EXPECT_THAT([&] { (void)read_picture(path); },
                ThrowsMessage<InputError>(HasSubstr("damaged.jpg: is damaged")))
        << bytes.size();
  }
  EXPECT_THROW((void)read_picture(folder_ / "none.jpg"), InputError);
}

}  // namespace
}  // namespace catgs
