#include "render_core/tools/render/frame_sink.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "render_core/image/host_image.h"
#include "render_core/image/png.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;
using ::testing::ThrowsMessage;

class FrameSinkTest : public ::testing::Test {
 protected:
  std::unique_ptr<FrameSink> sink(const std::string& name, glm::ivec2 size_px = {16, 8}) const {
    return make_frame_sink(
        {.path = folder_ / name, .size_px = size_px, .fps = 29.97, .first_frame = 7});
  }
  std::string bytes_of(const std::string& name) const {
    std::ifstream file(folder_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  const test::TemporaryFolder folder_;
};

FrameView grey_frame(HostImage& image, PixelFormat format, glm::ivec2 size_px) {
  image.resize(format, size_px);
  for (int y = 0; y < size_px.y; ++y) {
    if (format == PixelFormat::rgb_f32) {
      std::fill_n(image.rgb_row(y), size_px.x * 3, 0.5f);
    } else {
      std::fill_n(image.byte_row(0, y), size_px.x, std::uint8_t{126});
      if (y % 2 != 0) continue;
      std::fill_n(image.byte_row(1, y / 2), size_px.x / 2, std::uint8_t{1});
      std::fill_n(image.byte_row(2, y / 2), size_px.x / 2, std::uint8_t{2});
    }
  }
  FrameView frame;
  frame.format = format;
  frame.size_px = size_px;
  frame.planes = image.planes();
  return frame;
}

TEST_F(FrameSinkTest, AFolderGetsNumberedPictures) {
  const auto folder = sink("new/pictures");
  HostImage image;
  const FrameView frame = grey_frame(image, folder->format(), {16, 8});
  folder->write(frame, {}, {});
  folder->write(frame, {}, {});
  folder->finish();
  EXPECT_EQ(read_png(folder_ / "new/pictures/frame_000007.png").size_px, glm::ivec2(16, 8));
  EXPECT_NEAR(read_png(folder_ / "new/pictures/frame_000008.png").rgb[0], 0.5f, 0.003f);
}

TEST_F(FrameSinkTest, PicturesHaveTheNamesOfTheirPath) {
  using Names = std::vector<std::string>;
  const auto folder =
      make_frame_sink({.path = folder_ / "named",
                       .size_px = {16, 8},
                       .names = picture_names({"./test/r_0", "images/b.1.JPG"}).names});
  HostImage image;
  for (int i = 0; i < 2; ++i) folder->write(grey_frame(image, folder->format(), {16, 8}), {}, {});
  EXPECT_TRUE(std::filesystem::exists(folder_ / "named/r_0.png"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "named/b.1.png"));
  struct Case {
    Names of_path, names;
    std::string problem{};
  };
  for (const auto& [of_path, names, problem] : std::vector<Case>{
           {{"a/1.jpg", "b/1.jpg"}, {"a_1", "b_1"}},
           {{"frame.0001", "frame.0002"}, {"frame.0001", "frame.0002"}},
           {{"img.v0", "img.v1"}, {"img.v0", "img.v1"}},
           {{R"(C:\pics\im0.jpg)"}, {"im0"}},
           {{"../../etc/passwd", "x"}, {"passwd", "x"}},
           {{"a.png", "a.jpg"}, {}, R"("a.jpg" is the name of two)"},
           {{"c/1", "d/1", "c_1"}, {}, R"("c_1" is the name of two)"},
           {{"", "b"}, {}, R"("" is no name for a file)"},
           {{".."}, {}, R"(".." is no name for a file)"},
           {{"a\nb"}, {}, R"("a\x0ab" is no name for a file)"},
           {{std::string("a\0b", 3)}, {}, R"("a\x00b" is no name for a file)"},
           {{std::string(300, 'a')}, {}, '"' + std::string(80, 'a') + "\" is no name for a file"},
       }) {
    const PictureNames found = picture_names(of_path);
    EXPECT_EQ(found.names, names) << of_path[0];
    EXPECT_EQ(found.problem, problem);
  }
}

TEST_F(FrameSinkTest, Y4mIsTaggedAndComplete) {
  const auto video = sink("a.y4m");
  ASSERT_EQ(video->format(), PixelFormat::i420);
  HostImage image;
  const FrameView frame = grey_frame(image, PixelFormat::i420, {16, 8});
  video->write(frame, {}, {});
  video->write(frame, {}, {});
  video->finish();
  const std::string header = "YUV4MPEG2 W16 H8 F29970:1000 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n";
  const std::string picture =
      "FRAME\n" + std::string(128, 126) + std::string(32, 1) + std::string(32, 2);
  EXPECT_EQ(bytes_of("a.y4m"), header + picture + picture);
}

TEST_F(FrameSinkTest, Mp4IsCompleteOrRefused) {
  std::unique_ptr<FrameSink> video;
  try {
    video = sink("a.mp4");
  } catch (const InputError& error) {
    GTEST_SKIP() << error.what();
  }
  HostImage image;
  for (int i = 0; i < 5; ++i) video->write(grey_frame(image, PixelFormat::i420, {16, 8}), {}, {});
  video->finish();
  const std::string bytes = bytes_of("a.mp4");
  EXPECT_THAT(bytes.substr(4), StartsWith("ftyp"));
  EXPECT_THAT(bytes, HasSubstr("avcC"));
  EXPECT_THAT(bytes, HasSubstr("colrnclx"));
}

TEST_F(FrameSinkTest, RefusesWhatItCannotWrite) {
  EXPECT_THAT(
      [&] {
        sink("a.y4m", {15, 8});
      },
      ThrowsMessage<InputError>(HasSubstr("a video needs even sides")));
  EXPECT_THAT([&] { sink("a.gif"); },
              ThrowsMessage<InputError>(HasSubstr("unknown kind of output")));
  EXPECT_THROW(sink("no_such_folder/a.y4m"), InputError);
  folder_.write("file", "in the way");
  EXPECT_THROW(sink("file/pictures"), InputError);
}

}  // namespace
}  // namespace catgs
