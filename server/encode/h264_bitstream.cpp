#include "server/encode/h264_bitstream.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "server/encode/bit_io.h"

namespace catgs::h264 {

namespace {

using std::byte;

/// Payload without header byte and emulation prevention: 00 00 03 -> 00 00 (7.4.1).
std::vector<byte> unescape(std::span<const byte> payload) {
  std::vector<byte> raw;
  raw.reserve(payload.size());
  int zeros = 0;
  for (const byte value : payload) {
    if (zeros >= 2 && value == byte{3}) {
      zeros = 0;
      continue;
    }
    zeros = value == byte{0} ? zeros + 1 : 0;
    raw.push_back(value);
  }
  return raw;
}

/// A NAL unit of this header byte: the inverse of `unescape`.
std::vector<byte> escape(byte header, std::span<const byte> raw) {
  std::vector<byte> unit = {header};
  unit.reserve(raw.size() + 4);
  int zeros = 0;
  for (const byte value : raw) {
    if (zeros >= 2 && value <= byte{3}) {
      unit.push_back(byte{3});
      zeros = 0;
    }
    zeros = value == byte{0} ? zeros + 1 : 0;
    unit.push_back(value);
  }
  return unit;
}

void skip_scaling_list(BitReader& reader, int size) {  // 7.3.2.1.1.1
  int last = 8;
  int next = 8;
  for (int i = 0; i < size; ++i) {
    if (next != 0) {
      const std::int32_t delta = reader.signed_exp_golomb();
      if (delta < -128 || delta > 127) return reader.fail();
      next = (last + delta + 256) % 256;
    }
    last = next == 0 ? last : next;
  }
}

bool has_chroma_format(int profile_idc) {  // the profiles that 7.3.2.1.1 lists
  constexpr std::array profiles = {100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135};
  return std::find(profiles.begin(), profiles.end(), profile_idc) != profiles.end();
}

/// Returns chroma_format_idc.
int read_chroma_and_scaling(BitReader& reader) {
  const auto chroma_format = static_cast<int>(reader.exp_golomb());
  if (chroma_format > 3) reader.fail();
  if (chroma_format == 3) reader.flag();  // separate_colour_plane_flag
  reader.exp_golomb();                    // bit_depth_luma_minus8
  reader.exp_golomb();                    // bit_depth_chroma_minus8
  reader.flag();                          // qpprime_y_zero_transform_bypass_flag
  if (reader.flag()) {                    // seq_scaling_matrix_present_flag
    const int lists = chroma_format == 3 ? 12 : 8;
    for (int i = 0; i < lists; ++i) {
      if (reader.flag()) skip_scaling_list(reader, i < 6 ? 16 : 64);
    }
  }
  return chroma_format;
}

void skip_picture_order_count(BitReader& reader) {
  const std::uint32_t type = reader.exp_golomb();
  if (type == 0) {
    reader.exp_golomb();  // log2_max_pic_order_cnt_lsb_minus4
  } else if (type == 1) {
    reader.flag();               // delta_pic_order_always_zero_flag
    reader.signed_exp_golomb();  // offset_for_non_ref_pic
    reader.signed_exp_golomb();  // offset_for_top_to_bottom_field
    const std::uint32_t cycle = reader.exp_golomb();
    if (cycle > 255) reader.fail();
    for (std::uint32_t i = 0; i < cycle && !reader.failed(); ++i) reader.signed_exp_golomb();
  } else if (type > 2) {
    reader.fail();
  }
}

glm::ivec2 read_size(BitReader& reader, int chroma_format, bool& frame_mbs_only) {
  const std::uint32_t width_mbs = reader.exp_golomb() + 1;
  const std::uint32_t height_map_units = reader.exp_golomb() + 1;
  frame_mbs_only = reader.flag();
  if (!frame_mbs_only) reader.flag();      // mb_adaptive_frame_field_flag
  reader.flag();                           // direct_8x8_inference_flag
  constexpr std::uint32_t max_mbs = 4096;  // 65536 px a side: beyond every level, safe in int
  if (width_mbs > max_mbs || height_map_units > max_mbs) {
    reader.fail();
    return {};
  }
  const int fields = frame_mbs_only ? 1 : 2;
  glm::ivec2 size(static_cast<int>(width_mbs) * 16,
                  static_cast<int>(height_map_units) * 16 * fields);
  if (reader.flag()) {  // frame_cropping_flag; units of equations 7-19 to 7-22
    const int unit_x = chroma_format == 1 || chroma_format == 2 ? 2 : 1;
    const int unit_y = (chroma_format == 1 ? 2 : 1) * fields;
    std::array<std::uint32_t, 4> crop{};  // left, right, top, bottom
    for (std::uint32_t& side : crop) {
      side = reader.exp_golomb();
      if (side > max_mbs * 16) reader.fail();
    }
    if (reader.failed()) return {};
    size.x -= static_cast<int>(crop[0] + crop[1]) * unit_x;
    size.y -= static_cast<int>(crop[2] + crop[3]) * unit_y;
    if (size.x <= 0 || size.y <= 0) reader.fail();
  }
  return size;
}

void skip_hrd(BitReader& reader) {  // E.1.2
  const std::uint32_t count = reader.exp_golomb() + 1;
  if (count > 32) reader.fail();
  reader.bits(4);  // bit_rate_scale
  reader.bits(4);  // cpb_size_scale
  for (std::uint32_t i = 0; i < count && !reader.failed(); ++i) {
    reader.exp_golomb();  // bit_rate_value_minus1
    reader.exp_golomb();  // cpb_size_value_minus1
    reader.flag();        // cbr_flag
  }
  reader.bits(20);  // four 5-bit lengths
}

BitstreamRestriction read_restriction(BitReader& reader) {
  BitstreamRestriction restriction;
  restriction.motion_vectors_over_pic_boundaries = reader.flag();
  restriction.max_bytes_per_pic_denom = reader.exp_golomb();
  restriction.max_bits_per_mb_denom = reader.exp_golomb();
  restriction.log2_max_mv_length_horizontal = reader.exp_golomb();
  restriction.log2_max_mv_length_vertical = reader.exp_golomb();
  restriction.max_num_reorder_frames = reader.exp_golomb();
  restriction.max_dec_frame_buffering = reader.exp_golomb();
  return restriction;
}

void write_restriction(BitWriter& writer, const BitstreamRestriction& restriction) {
  writer.flag(restriction.motion_vectors_over_pic_boundaries);
  writer.exp_golomb(restriction.max_bytes_per_pic_denom);
  writer.exp_golomb(restriction.max_bits_per_mb_denom);
  writer.exp_golomb(restriction.log2_max_mv_length_horizontal);
  writer.exp_golomb(restriction.log2_max_mv_length_vertical);
  writer.exp_golomb(restriction.max_num_reorder_frames);
  writer.exp_golomb(restriction.max_dec_frame_buffering);
}

/// Bits from the start of the raw payload to two places that a rewrite needs.
struct SpsMarks {
  std::size_t vui_present_flag = 0;
  std::size_t restriction_flag = 0;  // only with a VUI
};

Vui read_vui(BitReader& reader, SpsMarks& marks) {  // E.1.1
  Vui vui;
  if (reader.flag()) {  // aspect_ratio_info_present_flag
    constexpr std::uint32_t extended_sar = 255;
    if (reader.bits(8) == extended_sar) reader.bits(32);
  }
  if (reader.flag()) reader.flag();  // overscan_info_present_flag, overscan_appropriate_flag
  if (reader.flag()) {               // video_signal_type_present_flag
    VideoSignal signal;
    reader.bits(3);  // video_format
    signal.full_range = reader.flag();
    if (reader.flag()) {  // colour_description_present_flag
      signal.primaries = static_cast<int>(reader.bits(8));
      signal.transfer = static_cast<int>(reader.bits(8));
      signal.matrix = static_cast<int>(reader.bits(8));
    }
    vui.video_signal = signal;
  }
  if (reader.flag()) {  // chroma_loc_info_present_flag
    vui.chroma_sample_loc_type = reader.exp_golomb();
    reader.exp_golomb();  // bottom field
  }
  if (reader.flag()) {  // timing_info_present_flag
    reader.bits(32);    // num_units_in_tick
    reader.bits(32);    // time_scale
    vui.fixed_frame_rate = reader.flag();
  }
  const bool nal_hrd = reader.flag();
  if (nal_hrd) skip_hrd(reader);
  const bool vcl_hrd = reader.flag();
  if (vcl_hrd) skip_hrd(reader);
  vui.has_hrd = nal_hrd || vcl_hrd;
  if (vui.has_hrd) reader.flag();  // low_delay_hrd_flag
  reader.flag();                   // pic_struct_present_flag
  marks.restriction_flag = reader.position();
  if (reader.flag()) vui.restriction = read_restriction(reader);
  return vui;
}

std::optional<Sps> parse_raw_sps(std::span<const byte> raw, SpsMarks& marks) {
  BitReader reader(raw);
  Sps sps;
  sps.profile_idc = static_cast<int>(reader.bits(8));
  sps.constraint_flags = static_cast<int>(reader.bits(8));
  sps.level_idc = static_cast<int>(reader.bits(8));
  if (reader.exp_golomb() > 31) reader.fail();  // seq_parameter_set_id
  const int chroma_format =
      has_chroma_format(sps.profile_idc) ? read_chroma_and_scaling(reader) : 1;
  const std::uint32_t frame_num_bits = reader.exp_golomb() + 4;
  if (frame_num_bits > 16) reader.fail();
  sps.frame_num_bits = static_cast<int>(frame_num_bits);
  skip_picture_order_count(reader);
  const std::uint32_t reference_frames = reader.exp_golomb();
  if (reference_frames > 16) reader.fail();
  sps.max_num_ref_frames = static_cast<int>(reference_frames);
  reader.flag();  // gaps_in_frame_num_value_allowed_flag
  sps.size_px = read_size(reader, chroma_format, sps.frame_mbs_only);
  marks.vui_present_flag = reader.position();
  if (reader.flag()) sps.vui = read_vui(reader, marks);
  if (reader.failed()) return std::nullopt;
  return sps;
}

}  // namespace

std::vector<NalUnit> split_annex_b(std::span<const byte> stream) {
  constexpr std::array start_code = {byte{0}, byte{0}, byte{1}};
  std::vector<NalUnit> units;
  auto unit = std::search(stream.begin(), stream.end(), start_code.begin(), start_code.end());
  while (unit != stream.end()) {
    unit += start_code.size();
    const auto next = std::search(unit, stream.end(), start_code.begin(), start_code.end());
    auto end = next;  // a NAL unit never ends in a zero byte (7.4.1): zeros belong to the framing
    while (end != unit && *(end - 1) == byte{0}) --end;
    if (end != unit) units.push_back({std::span(unit, end)});
    unit = next;
  }
  return units;
}

std::optional<Sps> parse_sps(NalUnit sps) {
  if (sps.type() != NalType::sps) return std::nullopt;
  SpsMarks marks;
  return parse_raw_sps(unescape(sps.bytes.subspan(1)), marks);
}

std::optional<std::vector<byte>> with_zero_reorder_frames(NalUnit sps) {
  if (sps.type() != NalType::sps) return std::nullopt;
  const std::vector<byte> raw = unescape(sps.bytes.subspan(1));
  SpsMarks marks;
  const std::optional<Sps> parsed = parse_raw_sps(raw, marks);
  if (!parsed) return std::nullopt;

  // The restriction ends the VUI and the VUI ends the SPS: keep the bits before, write the rest.
  BitReader reader(raw);
  BitWriter writer;
  const std::size_t kept = parsed->vui ? marks.restriction_flag : marks.vui_present_flag;
  while (reader.position() < kept) writer.flag(reader.flag());
  if (!parsed->vui) {
    writer.flag(true);  // vui_parameters_present_flag
    writer.bits(0,
                8);  // no aspect ratio, overscan, signal, chroma location, timing, HRDs, pic_struct
  }
  BitstreamRestriction restriction;
  restriction.max_dec_frame_buffering = static_cast<unsigned>(parsed->max_num_ref_frames);
  if (parsed->vui && parsed->vui->restriction) restriction = *parsed->vui->restriction;
  restriction.max_num_reorder_frames = 0;
  writer.flag(true);  // bitstream_restriction_flag
  write_restriction(writer, restriction);
  return escape(sps.bytes[0], std::move(writer).finish());
}

std::string codec_string(const Sps& sps) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "avc1.%02X%02X%02X", sps.profile_idc & 0xFF,
                sps.constraint_flags & 0xFF, sps.level_idc & 0xFF);
  return text.data();
}

}  // namespace catgs::h264
