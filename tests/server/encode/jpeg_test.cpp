#include <glm/geometric.hpp>

#include "server/encode/decoder.h"
#include "server/encode/encoder.h"
#include "server/encode/jpeg_color.h"
#include "server/encode/jpeg_rate.h"
#include "server/encode/test_picture.h"
#include "tests/server/encode/colour.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

// Every luma code against chroma codes in steps: the integer transform against BT.709 -> RGB ->
// BT.601 in double precision.
TEST(VideoToJfif, MatchesTheDefinitionsOnAllCodes) {
  for (int cb = 16; cb <= 240; cb += 7) {
    for (int cr = 16; cr <= 240; cr += 7) {
      I420Picture video({512, 2});
      for (std::size_t i = 0; i < 1024; ++i) video.planes[0][i] = static_cast<std::uint8_t>(i / 2);
      std::fill(video.planes[1].begin(), video.planes[1].end(), static_cast<std::uint8_t>(cb));
      std::fill(video.planes[2].begin(), video.planes[2].end(), static_cast<std::uint8_t>(cr));
      I420Picture jfif({512, 2});
      Yuv420Planes from;
      Yuv420Planes to;
      for (std::size_t i = 0; i < 3; ++i) {
        from.data[i] = video.planes[i].data();
        to.data[i] = jfif.planes[i].data();
        from.stride_bytes[i] = to.stride_bytes[i] = i == 0 ? 512 : 256;
      }
      video_to_jfif(from, to, {512, 2});
      for (int y = 16; y <= 235; ++y) {
        const double luma = (y - 16) / 219.0;
        const double pb = (cb - 128) / 224.0;
        const double pr = (cr - 128) / 224.0;
        const double r = luma + 1.5748 * pr;
        const double b = luma + 1.8556 * pb;
        const double g = (luma - 0.2126 * r - 0.0722 * b) / 0.7152;
        const double luma601 = 0.299 * r + 0.587 * g + 0.114 * b;
        const auto code = [](double value) { return std::clamp(value, 0.0, 255.0); };
        ASSERT_NEAR(jfif.planes[0][2 * y], code(255 * luma601), 0.51)
            << y << " " << cb << " " << cr;
        ASSERT_NEAR(jfif.planes[1][y], code(128 + 255 * (b - luma601) / 1.772), 0.51);
        ASSERT_NEAR(jfif.planes[2][y], code(128 + 255 * (r - luma601) / 1.402), 0.51);
      }
    }
  }
}

TEST(JpegEncoder, WritesJfifFilesThatDecodeToThePicture) {
  EncoderSettings settings;
  settings.size_px = {322, 182};
  settings.bitrate_kbps = 60000;
  const auto encoder = make_encoder(EncoderKind::jpeg, settings);
  EXPECT_EQ(encoder->codec(), Codec::mjpeg);
  EXPECT_EQ(encoder->codec_string(), "");
  Decoder decoder(Codec::mjpeg);
  EncodedFrame encoded;
  DecodedPicture decoded;
  for (int time = 0; time < 5; ++time) {
    I420Picture picture = moving_picture(settings.size_px, time);
    const EncodeStatus status = encoder->encode(picture.view(), false, encoded);
    ASSERT_TRUE(status.ok) << status.message;
    EXPECT_TRUE(encoded.idr);
    const std::array head = {0xFF, 0xD8,     0xFF,     0xE0,     0x00,
                             0x10, int{'J'}, int{'F'}, int{'I'}, int{'F'}};
    for (std::size_t i = 0; i < head.size(); ++i) {
      ASSERT_EQ(std::to_integer<int>(encoded.bytes.at(i)), head[i]);
    }
    ASSERT_TRUE(decoder.decode(encoded.bytes, decoded).ok);
    EXPECT_TRUE(decoded.full_range);
    const DecodedPicture source{picture.size_px, picture.planes, false, false};
    double squares = 0;
    int samples = 0;
    for (int y = 1; y < settings.size_px.y; y += 4) {
      for (int x = 1; x < settings.size_px.x; x += 4) {
        const glm::dvec3 error = test::rgb_at(decoded, {x, y}) - test::rgb_at(source, {x, y});
        squares += glm::dot(error, error) / 3;
        ++samples;
      }
    }
    EXPECT_LT(std::sqrt(squares / samples), 4) << "frame " << time;
  }
}

TEST(JpegRateControl, ConvergesOnTheBudgetOfAContentThatFollowsItsModel) {
  JpegRateControl rate(1280 * 720);
  rate.set_budget(20000, 30);  // 83 kB a frame
  const auto bytes = [](int qscale) {
    return static_cast<std::size_t>(600e3 / std::pow(qscale, 0.7));
  };
  rate.update(rate.qscale(), bytes(rate.qscale()));
  EXPECT_LE(bytes(rate.qscale()), 83333u);
  EXPECT_GT(bytes(rate.qscale() - 1), 83333u) << "not coarser than the budget asks for";
}

TEST(JpegRateControl, StaysInItsScale) {
  JpegRateControl rate(64 * 64);
  rate.set_budget(200000, 1);
  EXPECT_EQ(rate.qscale(), JpegRateControl::finest_qscale);
  rate.set_budget(100, 240);
  rate.update(31, 1000000);
  EXPECT_EQ(rate.qscale(), JpegRateControl::coarsest_qscale);
}

TEST(JpegEncoder, FollowsItsBitrate) {
  EncoderSettings settings;
  settings.size_px = {640, 360};
  settings.fps = 30;
  settings.bitrate_kbps = 20000;
  const auto encoder = make_encoder(EncoderKind::jpeg, settings);
  EncodedFrame encoded;
  const auto size_at = [&](int bitrate_kbps) {
    encoder->set_rate(bitrate_kbps, settings.fps);
    for (int time = 0; time < 5; ++time) {
      I420Picture picture = moving_picture(settings.size_px, time);
      EXPECT_TRUE(encoder->encode(picture.view(), false, encoded).ok);
    }
    return static_cast<double>(encoded.bytes.size());
  };
  for (const int bitrate_kbps : {20000, 8000, 14000}) {
    const double budget = bitrate_kbps * 125.0 / settings.fps;
    EXPECT_NEAR(size_at(bitrate_kbps) / budget, 0.9, 0.2) << bitrate_kbps;
  }
}

}  // namespace
}  // namespace catgs
