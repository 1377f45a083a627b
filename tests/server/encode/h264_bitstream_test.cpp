#include "server/encode/h264_bitstream.h"

#include "tests/support/test.h"

namespace catgs::h264 {
namespace {

std::vector<std::byte> from_hex(std::string_view hex) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes.push_back(std::byte(std::stoul(std::string(hex.substr(i, 2)), nullptr, 16)));
  return bytes;
}

std::string to_hex(std::span<const std::byte> bytes) {
  std::string hex;
  for (const std::byte value : bytes) {
    constexpr std::string_view digits = "0123456789abcdef";
    hex += digits[std::to_integer<unsigned>(value) >> 4];
    hex += digits[std::to_integer<unsigned>(value) & 15];
  }
  return hex;
}

// SPS NAL units of four kinds of encoder, as found in streams; their fields were read with
// libavcodec's trace_headers filter.
// Interlaced Main with a restriction that says two reordered frames.
constexpr std::string_view interlaced_main = "674d4028925280f0088fbc0440000003004000000ca3c58b6580";
// Interlaced High, broadcast: VUI with colour and timing, no restriction.
constexpr std::string_view broadcast_high =
    "67640029ac133140780447de03ea020203e000000300200000065280";
// A camera's High without any VUI.
constexpr std::string_view camera_high = "67640033ac1514a0a03d90";
// NVIDIA Jetson's NVENC: Baseline without any VUI, cropped.
constexpr std::string_view jetson_baseline = "67424033965403c0113f2a";

std::optional<Sps> parse(std::span<const std::byte> bytes) { return parse_sps({bytes}); }

TEST(SplitAnnexB, FindsUnitsBehindBothStartCodes) {
  const auto stream = from_hex(
      "ff00000001"
      "6742"
      "000001"
      "68ce00"
      "00000001"
      "65880400"
      "000001");
  std::vector<std::string> units;
  for (const NalUnit& unit : split_annex_b(stream)) units.push_back(to_hex(unit.bytes));
  EXPECT_THAT(units, ElementsAre("6742", "68ce", "658804"));
}

TEST(SplitAnnexB, TellsTypeAndReference) {
  const auto stream = from_hex(
      "000001"
      "6588"
      "000001"
      "419a"
      "000001"
      "0609");
  const auto units = split_annex_b(stream);
  ASSERT_EQ(units.size(), 3u);
  EXPECT_EQ(units[0].type(), NalType::idr_slice);
  EXPECT_EQ(units[0].ref_idc(), 3);
  EXPECT_EQ(units[1].type(), NalType::slice);
  EXPECT_EQ(units[1].ref_idc(), 2);
  EXPECT_EQ(units[2].type(), NalType::sei);
  EXPECT_EQ(units[2].ref_idc(), 0);
}

TEST(SplitAnnexB, NothingInNothing) {
  EXPECT_THAT(split_annex_b({}), IsEmpty());
  EXPECT_THAT(split_annex_b(from_hex("0000")), IsEmpty());
  EXPECT_THAT(split_annex_b(from_hex("000001")), IsEmpty());
  EXPECT_THAT(split_annex_b(from_hex("0000010000000001")), IsEmpty());
}

TEST(ParseSps, InterlacedMain) {
  const auto sps = parse(from_hex(interlaced_main));
  ASSERT_TRUE(sps);
  EXPECT_EQ(codec_string(*sps), "avc1.4D4028");
  EXPECT_EQ(sps->size_px, glm::ivec2(1920, 1080));  // 34 field map units, cropped by 2 x 4 lines
  EXPECT_FALSE(sps->frame_mbs_only);
  EXPECT_EQ(sps->frame_num_bits, 7);
  EXPECT_EQ(sps->max_num_ref_frames, 4);
  ASSERT_TRUE(sps->vui);
  EXPECT_FALSE(sps->vui->video_signal);
  EXPECT_TRUE(sps->vui->fixed_frame_rate);
  ASSERT_TRUE(sps->vui->restriction);
  EXPECT_EQ(sps->vui->restriction->log2_max_mv_length_horizontal, 10u);
  EXPECT_EQ(sps->vui->restriction->max_num_reorder_frames, 2u);
  EXPECT_EQ(sps->vui->restriction->max_dec_frame_buffering, 4u);
}

TEST(ParseSps, BroadcastHigh) {
  const auto sps = parse(from_hex(broadcast_high));
  ASSERT_TRUE(sps);
  EXPECT_EQ(codec_string(*sps), "avc1.640029");
  EXPECT_EQ(sps->size_px, glm::ivec2(1920, 1080));
  ASSERT_TRUE(sps->vui);
  ASSERT_TRUE(sps->vui->video_signal);
  EXPECT_FALSE(sps->vui->video_signal->full_range);
  EXPECT_EQ(sps->vui->video_signal->primaries, 1);
  EXPECT_EQ(sps->vui->video_signal->transfer, 1);
  EXPECT_EQ(sps->vui->video_signal->matrix, 1);
  EXPECT_EQ(sps->vui->chroma_sample_loc_type, 0u);
  EXPECT_FALSE(sps->vui->restriction);
}

TEST(ParseSps, ReadsAnSpsThatHasNoVui) {
  const auto camera = parse(from_hex(camera_high));
  ASSERT_TRUE(camera);
  EXPECT_EQ(camera->size_px, glm::ivec2(640, 480));
  EXPECT_EQ(camera->frame_num_bits, 13);
  EXPECT_FALSE(camera->vui);
  const auto jetson = parse(from_hex(jetson_baseline));
  ASSERT_TRUE(jetson);
  EXPECT_EQ(codec_string(*jetson), "avc1.424033");
  EXPECT_EQ(jetson->size_px, glm::ivec2(1920, 1080));
}

TEST(ParseSps, RefusesWhatIsNone) {
  EXPECT_FALSE(parse(from_hex("68ce3c80")));  // a PPS
  EXPECT_FALSE(parse(from_hex("67")));
  for (const std::string_view hex : {interlaced_main, broadcast_high}) {
    // Cut in front of its last fields, an SPS must not be mistaken for a whole one.
    const auto bytes = from_hex(hex);
    for (std::size_t size = 1; size + 3 < bytes.size(); ++size) {
      EXPECT_FALSE(parse(std::span(bytes).first(size))) << hex << " cut to " << size;
    }
  }
}

TEST(ParseSps, SurvivesNoise) {
  std::mt19937 random(7);
  for (int round = 0; round < 20000; ++round) {
    auto bytes = from_hex(round % 2 == 0 ? broadcast_high : interlaced_main);
    const int changes = 1 + static_cast<int>(random() % 4);
    for (int i = 0; i < changes; ++i)
      bytes[1 + random() % (bytes.size() - 1)] = std::byte(random() & 0xFF);
    const auto sps = parse(bytes);
    const auto rewritten = with_zero_reorder_frames({bytes});
    ASSERT_EQ(sps.has_value(), rewritten.has_value());
    if (!sps) continue;
    EXPECT_GT(sps->size_px.x, 0);
    EXPECT_GT(sps->size_px.y, 0);
    ASSERT_TRUE(parse(*rewritten)) << to_hex(bytes);
  }
}

class RewriteSps : public testing::TestWithParam<std::string_view> {};

TEST_P(RewriteSps, SaysZeroReorderFramesAndKeepsTheRest) {
  const auto bytes = from_hex(GetParam());
  const auto before = parse(bytes);
  const auto rewritten = with_zero_reorder_frames({bytes});
  ASSERT_TRUE(before);
  ASSERT_TRUE(rewritten);
  const auto after = parse(*rewritten);
  ASSERT_TRUE(after) << to_hex(*rewritten);
  EXPECT_EQ(codec_string(*after), codec_string(*before));
  EXPECT_EQ(after->size_px, before->size_px);
  EXPECT_EQ(after->frame_num_bits, before->frame_num_bits);
  EXPECT_EQ(after->max_num_ref_frames, before->max_num_ref_frames);
  ASSERT_TRUE(after->vui);
  ASSERT_TRUE(after->vui->restriction);
  EXPECT_EQ(after->vui->restriction->max_num_reorder_frames, 0u);
  EXPECT_EQ(after->vui->restriction->max_dec_frame_buffering,
            static_cast<unsigned>(before->max_num_ref_frames));
  if (before->vui) {
    EXPECT_EQ(after->vui->video_signal.has_value(), before->vui->video_signal.has_value());
    EXPECT_EQ(after->vui->fixed_frame_rate, before->vui->fixed_frame_rate);
  }
  // The same fix again changes nothing.
  EXPECT_EQ(with_zero_reorder_frames({*rewritten}), rewritten);
  // No start code and no bare 00 00 0x inside.
  const std::string hex = to_hex(*rewritten);
  for (const std::string_view bare : {"000000", "000001", "000002"}) {
    for (std::size_t at = hex.find(bare); at != std::string::npos; at = hex.find(bare, at + 1)) {
      EXPECT_NE(at % 2, 0u) << hex;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Encoders, RewriteSps,
                         testing::Values(interlaced_main, broadcast_high, camera_high,
                                         jetson_baseline));

// Read back with libavcodec's trace_headers filter as well: an independent reader.
TEST(RewrittenSps, GoldenBytes) {
  const auto golden = [](std::string_view hex) {
    return to_hex(with_zero_reorder_frames({from_hex(hex)}).value());
  };
  EXPECT_EQ(golden(jetson_baseline), "67424033965403c0113f2c03c2211a80");
  EXPECT_EQ(golden(broadcast_high),
            "67640029ac133140780447de03ea020203e0000003002000000653e1108cb0");
  EXPECT_EQ(golden(interlaced_main), "674d4028925280f0088fbc0440000003004000000ca3c58b96");
}

}  // namespace
}  // namespace catgs::h264
