#include <cstring>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "render_core/image/host_image.h"
#include "render_core/video/video_file.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

constexpr glm::ivec2 size_px{64, 48};

/// Frames of a film whose writing can be cancelled.
class Mp4File : public testing::Test {
 protected:
  void SetUp() override {
    image_.resize(PixelFormat::i420, size_px);
    try {
      video_ = make_mp4_file({(folder_ / "film.mp4").string(), size_px, 30.0, 1, [this] {
                                ++calls_;
                                if (cancelled_) throw std::runtime_error("cancelled");
                              }});
    } catch (const InputError& without_libav) {
      GTEST_SKIP() << without_libav.what();
    }
  }
  void write(int frames) {
    for (int i = 0; i < frames; ++i) {
      std::memset(image_.byte_row(0, 0), i, size_px.x * size_px.y * 3 / 2);
      video_->write({PixelFormat::i420, MemorySpace::host, size_px, image_.planes(), {}});
    }
  }

  const test::TemporaryFolder folder_;
  HostImage image_;
  int calls_ = 0;
  bool cancelled_ = false;
  std::unique_ptr<VideoFile> video_;
};

TEST_F(Mp4File, EndsWhileItIsWritten) {
  write(100);
  EXPECT_GE(calls_, 40) << "after each packet";
  cancelled_ = true;
  EXPECT_THROW(write(100), std::runtime_error);
}

TEST_F(Mp4File, EndsWhileItIsFinished) {
  write(30);  // libx264 keeps them all until the end
  const int before = calls_;
  cancelled_ = true;
  EXPECT_THROW(video_->finish(), std::runtime_error);
  EXPECT_LT(calls_ - before, 10);
}

TEST_F(Mp4File, IsFinishedUnlessItIsCancelled) {
  write(30);
  video_->finish();
  video_.reset();
  EXPECT_GT(std::filesystem::file_size(folder_ / "film.mp4"), 500u);
}

}  // namespace
}  // namespace catgs
