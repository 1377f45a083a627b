#include <algorithm>
#include <random>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "server/encode/decoder.h"
#include "server/encode/encoder.h"
#include "server/encode/h264_bitstream.h"
#include "tests/server/encode/moving_picture.h"

namespace catgs {
namespace {

using test::moving_picture;
using test::Picture;

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

std::vector<h264::NalType> types_of(const EncodedFrame& frame) {
  std::vector<h264::NalType> types;
  for (const h264::NalUnit& unit : units_of(frame)) types.push_back(unit.type());
  return types;
}

TEST(X264Encoder, FirstFrameIsAnIdrBehindItsParameterSets) {
  const auto encoder = make_encoder(EncoderKind::x264, settings_of(small_px));
  EncodedFrame out;
  Picture picture = moving_picture(small_px, 0);
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
  Picture picture = moving_picture(small_px, 0);
  ASSERT_TRUE(encoder->encode(picture.view(), false, out).ok);
  const auto sps = h264::parse_sps(units_of(out).at(0));
  ASSERT_TRUE(sps);
  EXPECT_EQ(sps->size_px, small_px);
  EXPECT_TRUE(sps->frame_mbs_only);
  EXPECT_EQ(sps->max_num_ref_frames, 1);
  EXPECT_EQ(h264::codec_string(*sps), encoder->codec_string());
  EXPECT_EQ(encoder->codec_string(), "avc1.42C01E");  // Constrained Baseline, level 3.0
  ASSERT_TRUE(sps->vui);
  EXPECT_FALSE(sps->vui->has_hrd);
  EXPECT_EQ(sps->vui->chroma_sample_loc_type.value_or(0), 0u);
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
      Picture picture = moving_picture(small_px, time < 30 ? time : time + 4000);
      const EncodeStatus status = encoder->encode(picture.view(), wanted.contains(time), out);
      ASSERT_TRUE(status.ok) << status.message;
      EXPECT_EQ(out.idr, wanted.contains(time)) << "frame " << time;
      int pictures = 0;
      int slices = 0;
      for (const h264::NalUnit& unit : units_of(out)) {
        EXPECT_NE(unit.type(), h264::NalType::access_unit_delimiter);
        if (const auto slice = h264::parse_slice_head(unit)) {
          ++slices;
          if (slice->first_mb == 0) ++pictures;
          EXPECT_EQ(slice->type, out.idr ? h264::SliceType::i : h264::SliceType::p);
          EXPECT_EQ(unit.type(), out.idr ? h264::NalType::idr_slice : h264::NalType::slice);
        }
      }
      EXPECT_EQ(pictures, 1) << "frame " << time;
      EXPECT_EQ(slices, threads) << "frame " << time;
      const auto types = types_of(out);
      EXPECT_EQ(std::count(types.begin(), types.end(), h264::NalType::sps), out.idr ? 1 : 0);
      EXPECT_EQ(std::count(types.begin(), types.end(), h264::NalType::pps), out.idr ? 1 : 0);
    }
  }
}

TEST(X264Encoder, DecodesToWhatWentIn) {
  const auto encoder = make_encoder(EncoderKind::x264, settings_of(small_px));
  Decoder decoder(Codec::h264);
  EncodedFrame out;
  DecodedPicture decoded;
  for (int time = 0; time < 30; ++time) {
    Picture picture = moving_picture(small_px, time);
    ASSERT_TRUE(encoder->encode(picture.view(), time == 11, out).ok);
    const EncodeStatus status = decoder.decode(out.bytes, decoded);
    ASSERT_TRUE(status.ok) << status.message;  // one in, one out: no reordering delay
    ASSERT_EQ(decoded.size_px, small_px);
    EXPECT_FALSE(decoded.full_range);
    EXPECT_EQ(decoded.idr, out.idr);
    EXPECT_GT(test::psnr(decoded.planes[0], picture.planes[0]), 34) << "frame " << time;
    EXPECT_GT(test::psnr(decoded.planes[1], picture.planes[1]), 36) << "frame " << time;
    EXPECT_GT(test::psnr(decoded.planes[2], picture.planes[2]), 36) << "frame " << time;
  }
}

}  // namespace
}  // namespace catgs
