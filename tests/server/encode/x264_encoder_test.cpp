#include "server/encode/bit_io.h"
#include "server/encode/decoder.h"
#include "server/encode/encoder.h"
#include "server/encode/h264_bitstream.h"
#include "server/encode/test_picture.h"
#include "tests/server/encode/colour.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr glm::ivec2 small_px(322, 182);  // no multiples of 16: the SPS must crop

EncoderSettings settings_of(glm::ivec2 size_px, int bitrate_kbps = 8000, int fps = 60) {
  EncoderSettings settings;
  settings.size_px = size_px;
  settings.fps = fps;
  settings.bitrate_kbps = bitrate_kbps;
  return settings;
}

std::vector<h264::NalUnit> units_of(const EncodedFrame& frame) {
  return h264::split_annex_b(frame.bytes);
}

enum class SliceType { p, b, i, sp, si };

struct SliceHead {
  unsigned first_mb = 0;  // 0 begins a picture
  SliceType type = SliceType::i;
};

/// The head of a slice (7.3.3), nothing for other units. The pictures of these tests are so small
/// that it has no emulation prevention bytes.
std::optional<SliceHead> slice_head(const h264::NalUnit& unit) {
  if (unit.type() != h264::NalType::slice && unit.type() != h264::NalType::idr_slice)
    return std::nullopt;
  h264::BitReader reader(unit.bytes.subspan(1));
  const std::uint32_t first_mb = reader.exp_golomb(), type = reader.exp_golomb();
  EXPECT_FALSE(reader.failed());
  EXPECT_LE(type, 9u);
  return SliceHead{first_mb, static_cast<SliceType>(type % 5)};
}

std::vector<h264::NalType> types_of(const EncodedFrame& frame) {
  std::vector<h264::NalType> types;
  for (const h264::NalUnit& unit : units_of(frame)) types.push_back(unit.type());
  return types;
}

// Fine texture beside smooth structure: the quantiser's help goes to the smooth parts.
TEST(X264Encoder, AdaptiveQuantisationCostsPsnr) {
  const auto mean_db = [](double strength) {
    EncoderSettings settings = settings_of({640, 360}, 2000);
    settings.aq_strength = strength;
    const auto encoder = make_encoder(EncoderKind::x264, settings);
    Decoder decoder(Codec::h264);
    EncodedFrame out;
    DecodedPicture decoded;
    double sum_db = 0.0;
    constexpr int frames = 20;
    for (int i = 0; i < frames; ++i) {
      I420Picture picture = moving_picture(settings.size_px, i);
      EXPECT_TRUE(encoder->encode(picture.view(), false, out).ok);
      EXPECT_TRUE(decoder.decode(out.bytes, decoded).ok);
      sum_db += psnr(decoded.planes[0], picture.planes[0]);
    }
    return sum_db / frames;
  };
  const double none_db = mean_db(0.0), usual_db = mean_db(default_aq_strength),
               strong_db = mean_db(max_aq_strength);
  EXPECT_GT(none_db, strong_db + 0.2);
  EXPECT_GT(usual_db, strong_db + 0.1);
}

TEST(X264Encoder, FirstFrameIsAnIdrBehindItsParameterSets) {
  const auto encoder = make_encoder(EncoderKind::x264, settings_of(small_px));
  EncodedFrame out;
  I420Picture picture = moving_picture(small_px, 0);
  const EncodeStatus status = encoder->encode(picture.view(), false, out);
  ASSERT_TRUE(status.ok) << status.message;
  EXPECT_TRUE(out.idr);
  const auto types = types_of(out);
  ASSERT_GE(types.size(), 3u);
  EXPECT_EQ(types[0], h264::NalType::sps);
  EXPECT_EQ(types[1], h264::NalType::pps);
  EXPECT_EQ(types.back(), h264::NalType::idr_slice);
}

TEST(X264Encoder, SpsSaysWhatTheStreamIs) {
  const auto encoder = make_encoder(EncoderKind::x264, settings_of(small_px));
  EncodedFrame out;
  I420Picture picture = moving_picture(small_px, 0);
  ASSERT_TRUE(encoder->encode(picture.view(), false, out).ok);
  const auto sps = h264::parse_sps(units_of(out).at(0));
  ASSERT_TRUE(sps);
  EXPECT_EQ(sps->size_px, small_px);
  EXPECT_TRUE(sps->frame_mbs_only);
  EXPECT_EQ(sps->max_num_ref_frames, 1);
  EXPECT_EQ(h264::codec_string(*sps), encoder->codec_string());
  EXPECT_EQ(encoder->codec_string(), "avc1.64001E");  // High, level 3.0
  ASSERT_TRUE(sps->vui);
  EXPECT_FALSE(sps->vui->has_hrd);
  EXPECT_EQ(sps->vui->chroma_sample_loc_type, 1u);  // in the middle of 2x2 pixels
  ASSERT_TRUE(sps->vui->video_signal);
  EXPECT_FALSE(sps->vui->video_signal->full_range);
  EXPECT_EQ(sps->vui->video_signal->primaries, 1);
  EXPECT_EQ(sps->vui->video_signal->transfer, 1);
  EXPECT_EQ(sps->vui->video_signal->matrix, 1);
  ASSERT_TRUE(sps->vui->restriction);
  EXPECT_EQ(sps->vui->restriction->max_num_reorder_frames, 0u);
  EXPECT_EQ(sps->vui->restriction->max_dec_frame_buffering, 1u);
}

// One access unit per frame: exactly one picture, no delimiters (a message of the wire delimits),
// no B slices, and parameter sets exactly where the IDRs are.
TEST(X264Encoder, EveryFrameIsOneAccessUnitAndIdrsComeOnlyOnDemand) {
  for (const int threads : {1, 3}) {
    EncoderSettings settings = settings_of(small_px);
    settings.threads = threads;
    const auto encoder = make_encoder(EncoderKind::x264, settings);
    EncodedFrame out;
    const std::set<int> wanted = {0, 1, 17, 18, 40};
    for (int time = 0; time < 60; ++time) {
      // A jump to another place of the scene at 30 must stay a P-frame.
      I420Picture picture = moving_picture(small_px, time < 30 ? time : time + 4000);
      const EncodeStatus status = encoder->encode(picture.view(), wanted.contains(time), out);
      ASSERT_TRUE(status.ok) << status.message;
      EXPECT_EQ(out.idr, wanted.contains(time)) << "frame " << time;
      int pictures = 0;
      int slices = 0;
      for (const h264::NalUnit& unit : units_of(out)) {
        EXPECT_NE(unit.type(), h264::NalType::access_unit_delimiter);
        if (const auto slice = slice_head(unit)) {
          ++slices;
          if (slice->first_mb == 0) ++pictures;
          EXPECT_EQ(slice->type, out.idr ? SliceType::i : SliceType::p);
          EXPECT_EQ(unit.type(), out.idr ? h264::NalType::idr_slice : h264::NalType::slice);
        }
      }
      EXPECT_EQ(pictures, 1) << "frame " << time;
      EXPECT_EQ(slices, std::min(threads, 2)) << "frame " << time;
      const auto types = types_of(out);
      EXPECT_EQ(std::count(types.begin(), types.end(), h264::NalType::sps), out.idr ? 1 : 0);
      EXPECT_EQ(std::count(types.begin(), types.end(), h264::NalType::pps), out.idr ? 1 : 0);
    }
  }
}

class X264Slices : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(X264Encoder, X264Slices, testing::Values(1, 3));

TEST_P(X264Slices, DecodeToWhatWentIn) {
  EncoderSettings settings = settings_of(small_px);
  settings.threads = GetParam();
  const auto encoder = make_encoder(EncoderKind::x264, settings);
  Decoder decoder(Codec::h264);
  EncodedFrame out;
  DecodedPicture decoded;
  for (int time = 0; time < 30; ++time) {
    I420Picture picture = moving_picture(small_px, time);
    ASSERT_TRUE(encoder->encode(picture.view(), time == 11, out).ok);
    const EncodeStatus status = decoder.decode(out.bytes, decoded);
    ASSERT_TRUE(status.ok) << status.message;  // one in, one out: no reordering delay
    ASSERT_EQ(decoded.size_px, small_px);
    EXPECT_FALSE(decoded.full_range);
    EXPECT_EQ(decoded.idr, out.idr);
    EXPECT_GT(psnr(decoded.planes[0], picture.planes[0]), 34) << "frame " << time;
    EXPECT_GT(psnr(decoded.planes[1], picture.planes[1]), 36) << "frame " << time;
    EXPECT_GT(psnr(decoded.planes[2], picture.planes[2]), 36) << "frame " << time;
  }
}

double largest_share(Encoder& encoder, int first_time, int frames, double budget_bytes) {
  EncodedFrame out;
  double largest = 0;
  for (int time = first_time; time < first_time + frames; ++time) {
    I420Picture picture = moving_picture({640, 360}, time);
    EXPECT_TRUE(encoder.encode(picture.view(), false, out).ok);
    EXPECT_EQ(out.idr, time == 0);
    if (time > 0) largest = std::max(largest, static_cast<double>(out.bytes.size()) / budget_bytes);
  }
  return largest;
}

// The VBV of one frame: no P-frame may take a link of that bitrate longer than its frame interval.
TEST(X264Encoder, NoFrameOutgrowsItsShareOfTheBitrate) {
  for (const int bitrate_kbps : {500, 2000, 8000}) {
    const auto encoder = make_encoder(EncoderKind::x264, settings_of({640, 360}, bitrate_kbps, 60));
    const double budget_bytes = bitrate_kbps * 125.0 / 60;
    EXPECT_LE(largest_share(*encoder, 0, 60, budget_bytes), 1.1) << bitrate_kbps;
  }
}

// libx264 takes whole kbit, of which a frame has few then.
TEST(X264Encoder, LowRatesAreUsedAndKept) {
  constexpr std::pair<int, int> cases[] = {{100, 10}, {100, 60}, {130, 60},
                                           {170, 30}, {250, 60}, {400, 15}};
  for (const auto& [bitrate_kbps, fps] : cases) {
    for (const int threads : {1, 2}) {
      EncoderSettings settings = settings_of({640, 360}, bitrate_kbps, 60);
      settings.threads = threads;
      const auto encoder = make_encoder(EncoderKind::x264, settings);
      encoder->set_rate(bitrate_kbps, fps);
      const double share = largest_share(*encoder, 0, 30, bitrate_kbps * 125.0 / fps);
      EXPECT_GE(share, 0.7) << bitrate_kbps << " kbit/s at " << fps << ", " << threads;
      EXPECT_LE(share, 1.2) << bitrate_kbps << " kbit/s at " << fps << ", " << threads;
    }
  }
}

TEST(X264Encoder, IdrsFitTheirShareToo) {
  const auto encoder = make_encoder(EncoderKind::x264, settings_of({640, 360}, 8000, 60));
  EncodedFrame out;
  for (int time = 0; time < 20; ++time) {
    I420Picture picture = moving_picture({640, 360}, 50 * time);
    ASSERT_TRUE(encoder->encode(picture.view(), time % 5 == 0, out).ok);
    EXPECT_LE(static_cast<double>(out.bytes.size()), 1.2 * 8000 * 125.0 / 60) << "frame " << time;
  }
}

TEST(X264Encoder, RateChangesTakeEffectWithoutAnIdr) {
  const auto encoder = make_encoder(EncoderKind::x264, settings_of({640, 360}, 8000, 60));
  const double budget_bytes = 8000 * 125.0 / 60;
  EXPECT_GT(largest_share(*encoder, 0, 15, budget_bytes), 0.6);
  encoder->set_rate(2000, 60);
  EXPECT_LE(largest_share(*encoder, 15, 15, budget_bytes / 4), 1.1);
  // A quarter of the frames: each may have four times the bits.
  encoder->set_rate(2000, 15);
  const double share = largest_share(*encoder, 30, 15, budget_bytes);
  EXPECT_LE(share, 1.1);
  EXPECT_GT(share, 0.6);
  encoder->set_rate(8000, 60);
  EXPECT_GT(largest_share(*encoder, 45, 15, budget_bytes), 0.6);
}

TEST(X264Encoder, RatesBeyondReasonAreClamped) {
  const auto encoder = make_encoder(EncoderKind::x264, settings_of({640, 360}, 8000, 60));
  encoder->set_rate(-5, 0);
  EXPECT_LE(largest_share(*encoder, 0, 5, 100 * 125.0), 1.1);  // 100 kbit/s in one frame a second
  encoder->set_rate(2'000'000'000, 2'000'000'000);
  // Level 3.1 ends at 14 Mbit/s.
  EXPECT_LE(largest_share(*encoder, 5, 15, 14000 * 125.0 / 60), 1.1);
}

TEST(X264Encoder, AStillPictureIsRefinedByItself) {
  const auto encoder = make_encoder(EncoderKind::x264, settings_of({640, 360}, 4000, 60));
  Decoder decoder(Codec::h264);
  EncodedFrame out;
  DecodedPicture decoded;
  I420Picture picture = moving_picture({640, 360}, 0);
  double first = 0;
  for (int frame = 0; frame < 20; ++frame) {
    ASSERT_TRUE(encoder->encode(picture.view(), false, out).ok);
    ASSERT_TRUE(decoder.decode(out.bytes, decoded).ok);
    if (frame == 0) first = psnr(decoded.planes[0], picture.planes[0]);
  }
  EXPECT_GT(psnr(decoded.planes[0], picture.planes[0]), first + 5);
}

TEST(X264Encoder, RefusesSizesBeyondAllLevelsAndUnknownPresets) {
  EXPECT_THAT(
      [] {
        make_encoder(EncoderKind::x264, settings_of({8192, 8192}));
      },
      ThrowsMessage<InputError>(HasSubstr("more than any H.264 level admits")));
  EncoderSettings settings = settings_of(small_px);
  settings.x264_preset = "fastest";
  testing::internal::CaptureStderr();
  EXPECT_EQ(test::refused_field([&] { make_encoder(EncoderKind::x264, settings); }),
            "preset fastest");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(X264Encoder, OtherPresetsKeepTheRules) {
  EncoderSettings settings = settings_of(small_px);
  settings.x264_preset = "ultrafast";
  const auto encoder = make_encoder(EncoderKind::x264, settings);
  EXPECT_EQ(encoder->codec_string(), "avc1.42C01E");  // Constrained Baseline
  Decoder decoder(Codec::h264);
  EncodedFrame out;
  DecodedPicture decoded;
  for (int time = 0; time < 30; ++time) {
    I420Picture picture = moving_picture(small_px, time < 15 ? time : time + 4000);
    ASSERT_TRUE(encoder->encode(picture.view(), false, out).ok);
    EXPECT_EQ(out.idr, time == 0);
    const EncodeStatus status = decoder.decode(out.bytes, decoded);
    ASSERT_TRUE(status.ok) << status.message;
    for (const h264::NalUnit& unit : units_of(out)) {
      if (const auto slice = slice_head(unit)) {
        EXPECT_EQ(slice->type, time == 0 ? SliceType::i : SliceType::p);
      }
    }
  }
}

}  // namespace
}  // namespace catgs
