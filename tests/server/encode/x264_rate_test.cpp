// What libx264 makes of its rate with any number of threads, on pictures as visitors see them: the
// demo city on the path of a head, and then at rest. Slices that wait for each other differ from
// run to run, so nothing here compares bytes.

#include <fmt/format.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/cpu_renderer.h"
#include "render_core/motion/script.h"
#include "render_core/synth/synth.h"
#include "server/encode/decoder.h"
#include "server/encode/encoder.h"
#include "server/encode/test_picture.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr glm::ivec2 size_px(1920, 1080);
constexpr int kbps = 8000, fps = 60, still_fps = 13, slow_fps = 20;
constexpr int frames = 30, settled_after = 10;  // the first IDR is coarse
constexpr double budget_bytes = kbps * 125.0 / fps;

/// An encoder, and what came of its pictures.
class Coder {
 public:
  explicit Coder(int threads) : threads_(threads) {
    EncoderSettings settings;
    settings.size_px = size_px;
    settings.fps = fps;
    settings.bitrate_kbps = kbps;
    settings.threads = threads;
    encoder_ = make_encoder(EncoderKind::x264, settings);
  }

  /// The first picture of a session that is slower than its nominal rate.
  void begins(const FrameView& picture) {
    encoder_->set_rate(kbps, slow_fps);
    db_.push_back(code(picture));
    mean_use = static_cast<double>(frame_.bytes.size()) / (kbps * 125.0 / slow_fps);
  }
  void moves(const FrameView& picture, bool counts) {
    const double db = code(picture);
    if (!counts) return;
    const double use = static_cast<double>(frame_.bytes.size()) / budget_bytes;
    mean_use += use / (frames - settled_after);
    most_use = std::max(most_use, use);
    db_.push_back(db);
  }
  void rests(const FrameView& picture) {
    encoder_->set_rate(kbps, still_fps);
    for (refinements = 0; refinements < 30 && (refinements == 0 || !frame_.sharp); ++refinements)
      rest_db = code(picture);
  }
  [[nodiscard]] int threads() const { return threads_; }
  [[nodiscard]] bool sharp() const { return frame_.sharp; }
  /// The median, because one picture of a busy machine, whose slice waited for a processor, moves a
  /// mean of 20 by a decibel.
  [[nodiscard]] double median_db() const {
    std::vector<double> sorted = db_;
    std::ranges::sort(sorted);
    return sorted[sorted.size() / 2];
  }

  double mean_use = 0, most_use = 0, rest_db = 0;
  int refinements = 0;

 private:
  double code(const FrameView& picture) {
    EXPECT_TRUE(encoder_->encode(picture, false, frame_).ok);
    EXPECT_TRUE(decoder_.decode(frame_.bytes, decoded_).ok);
    std::vector<std::uint8_t> luma;
    for (int y = 0; y < size_px.y; ++y) {
      const auto* row = reinterpret_cast<const std::uint8_t*>(
          picture.planes[0].data + static_cast<std::size_t>(y) * picture.planes[0].stride_bytes);
      luma.insert(luma.end(), row, row + size_px.x);
    }
    return psnr(decoded_.planes[0], luma);
  }

  int threads_;
  std::vector<double> db_;
  std::unique_ptr<Encoder> encoder_;
  Decoder decoder_{Codec::h264};
  EncodedFrame frame_;
  DecodedPicture decoded_;
};

/// One, two, four and eight threads over the same pictures.
class X264Rate : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    for (const int threads : {1, 2, 4, 8}) {
      coders.push_back(std::make_unique<Coder>(threads));
      slow_coders.push_back(std::make_unique<Coder>(threads));
    }
    const auto pool = std::make_shared<ThreadPool>(2);
    const Scene city = synthesize(SynthKind::city, 300'000, 1, *pool);
    const auto view = make_cpu_renderer(city.cloud, pool, "auto")
                          ->make_view({.pipeline = Pipeline::catgs, .format = PixelFormat::i420});
    FrameView picture;
    const Trajectory path = make_script({"head", 1, 4.0, fps}, city.hints);
    for (int i = 0; i < frames; ++i) {
      FrameRequest request;
      request.camera = make_camera(path.at(static_cast<std::size_t>(60 + i)).world_from_camera,
                                   size_px, 1100.0f, city.hints.near_z);
      ASSERT_TRUE(view->render(request, picture).ok());
      for (const auto& coder : coders) coder->moves(picture, i >= settled_after);
      if (i > 0) continue;
      for (const auto& coder : slow_coders) coder->begins(picture);
    }
    for (const auto& coder : coders) coder->rests(picture);
  }
  static void TearDownTestSuite() {
    coders.clear();
    slow_coders.clear();
  }

  /// In the test's report, such as --gtest_output=json.
  static void record(const std::string& what, const Coder& coder, double value) {
    RecordProperty(fmt::format("{}_with_{}_threads", what, coder.threads()),
                   fmt::format("{:.2f}", value));
  }

  static inline std::vector<std::unique_ptr<Coder>> coders, slow_coders;
};

TEST_F(X264Rate, IsUsedWithAnyNumberOfThreads) {
  for (const auto& coder : coders) {
    EXPECT_GE(coder->mean_use, 0.87) << coder->threads() << " threads: 0.85 without RateMargins";
    EXPECT_LE(coder->most_use, 1.2) << coder->threads() << " threads";
    EXPECT_GE(coder->median_db(), coders[0]->median_db() - 0.5) << coder->threads() << " threads";
    record("use", *coder, coder->mean_use);
    record("median_db", *coder, coder->median_db());
  }
}

TEST_F(X264Rate, FirstPictureUsesTheRateOfASlowSession) {
  for (const auto& coder : slow_coders) {
    EXPECT_GE(coder->mean_use, 0.6) << coder->threads() << " threads";
    EXPECT_LE(coder->mean_use, 1.2) << coder->threads() << " threads";
    EXPECT_GE(coder->median_db(), slow_coders[0]->median_db() - 3.0) << coder->threads();
  }
}

TEST_F(X264Rate, StillsEndSharpAndAlikeWithAnyNumberOfThreads) {
  for (const auto& coder : coders) {
    EXPECT_TRUE(coder->sharp()) << coder->threads() << " threads";
    EXPECT_GE(coder->rest_db, 47.0) << coder->threads() << " threads";
    EXPECT_NEAR(coder->rest_db, coders[0]->rest_db, 0.3) << coder->threads() << " threads";
    record("rest_db", *coder, coder->rest_db);
    record("refinements", *coder, coder->refinements);
  }
}

}  // namespace
}  // namespace catgs
