#include "render_core/image/png.h"

#include <cstdint>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/image/host_image.h"
#include "tests/support/read_rgba.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using ::testing::ElementsAre;
using ::testing::FloatNear;
using ::testing::Pointwise;

class Png : public ::testing::Test {
 protected:
  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "picture.png";
};

Image ramp(int width, int height) {
  Image image{{width, height}, {}};
  for (int i = 0; i < width * height * 3; ++i) {
    image.rgb.push_back(static_cast<float>(i * 7 % 256) / 255.0f);
  }
  return image;
}

TEST_F(Png, KeepsEveryByteValue) {
  const Image image = ramp(37, 21);
  write_png(path_, image);
  const Image read = read_png(path_);
  EXPECT_EQ(read.size_px, image.size_px);
  EXPECT_EQ(read.rgb, image.rgb);
}

TEST_F(Png, RoundsAndClamps) {
  write_png(path_, {{2, 1}, {-1.0f, 0.5f, 2.0f, 0.49f / 255.0f, 0.51f / 255.0f, 1.0f}});
  const std::vector<float> expected = {0, 128.0f / 255.0f, 1, 0, 1.0f / 255.0f, 1};
  EXPECT_EQ(read_png(path_).rgb, expected);
}

TEST_F(Png, AlphaBelongsToColoursOverBlack) {
  const std::vector<float> alpha = {0.5f, 0.0f, 1.0f};
  write_png(path_, {{3, 1}, {0.25f, 0.5f, 0, 0, 0, 0, 0.2f, 0.4f, 0.6f}}, alpha);
  EXPECT_THAT(test::read_rgba(path_), ElementsAre(128, 255, 0, 128, 0, 0, 0, 0, 51, 102, 153, 255));
  const std::vector<float> over_black = {0.252f, 0.502f, 0, 0, 0, 0, 0.2f, 0.4f, 0.6f};
  EXPECT_THAT(read_png(path_).rgb, Pointwise(FloatNear(1e-3f), over_black));
}

TEST_F(Png, KeepsATextOnceAndBeforeItsPixels) {
  write_png(path_, ramp(8, 8), {}, {}, {"key", "some words"});
  EXPECT_EQ(text_in_png(path_, "key"), "some words");
  EXPECT_EQ(text_in_png(path_, "ke"), "");
  EXPECT_EQ(read_png(path_).rgb, ramp(8, 8).rgb);
  write_png(path_, ramp(8, 8));
  EXPECT_EQ(text_in_png(path_, "key"), "");
  for (const char* other : {"", "no picture", "\x89PNG\r\n\x1a\n\xff\xff\xff\xfftEXt"})
    EXPECT_EQ(text_in_png(folder_.write("other.png", other), "key"), "");
  EXPECT_EQ(text_in_png(folder_ / "absent.png", "key"), "");
}

TEST_F(Png, RefusesWhatIsNoPicture) {
  const auto refusal = [&] { return test::refusal_of([&] { read_png(path_); }); };
  const test::Refusal whole{path_.string(), ""}, size{path_.string(), "size"};
  EXPECT_EQ(refusal(), whole) << "it is not there";
  std::ofstream(path_) << "no picture";
  EXPECT_EQ(refusal(), whole);
  write_png(path_, ramp(200, 100));
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) / 2);
  EXPECT_EQ(refusal(), whole);
  write_png(path_, ramp(max_image_side_px + 1, 1));
  EXPECT_EQ(refusal(), size);
  EXPECT_THROW(write_png("/nonexistent/folder/a.png", ramp(1, 1)), InputError);
}

TEST_F(Png, EndsBetweenRowsAndLeavesNoFile) {
  int rows = 0;
  const auto count = [&] { ++rows; };
  write_png(path_, ramp(8, 30), {}, count);
  EXPECT_EQ(rows, 30);
  const std::vector<std::uint8_t> bytes(3 * 8 * 30);
  write_png(path_, {8, 30}, bytes, count);
  EXPECT_EQ(rows, 60);
  const auto cancel = [&] {
    if (++rows == 70) throw std::runtime_error("cancelled");
  };
  EXPECT_THROW(write_png(path_, {8, 30}, bytes, cancel), std::runtime_error);
  EXPECT_EQ(rows, 70);
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(Png, FullDiskIsNamed) {
  EXPECT_EQ(test::refusal_of([] { write_png("/dev/full", ramp(300, 300)); }).source, "/dev/full");
  EXPECT_TRUE(std::filesystem::exists("/dev/full"));
}

TEST(CopyImage, FollowsTheStride) {
  const std::vector<float> pixels = {1, 2, 3, 4, 5, 6, -1, -1, 7, 8, 9, 10, 11, 12, -1, -1};
  FrameView frame;
  frame.size_px = {2, 2};
  frame.planes[0] = {reinterpret_cast<std::byte*>(const_cast<float*>(pixels.data())),
                     8 * sizeof(float)};
  const std::vector<float> expected = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
  EXPECT_EQ(copy_image(frame).rgb, expected);
  frame.format = PixelFormat::i420;
  EXPECT_THROW(copy_image(frame), std::invalid_argument);
}

}  // namespace
}  // namespace catgs
