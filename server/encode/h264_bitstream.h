#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <glm/vec2.hpp>

namespace catgs::h264 {

// The part of ITU-T H.264 (08/2021) that a server must read and write by itself: NAL units in Annex
// B byte streams and sequence parameter sets. Pure functions on bytes;
// malformed input gives nullopt, never a read past the end.

enum class NalType : std::uint8_t {
  slice = 1,
  idr_slice = 5,
  sei = 6,
  sps = 7,
  pps = 8,
  access_unit_delimiter = 9,
};

/// One NAL unit, borrowed from the stream: header byte and payload, without the start code.
struct NalUnit {
  std::span<const std::byte> bytes;  // never empty
  [[nodiscard]] NalType type() const { return NalType{static_cast<std::uint8_t>(header() & 0x1F)}; }
  [[nodiscard]] int ref_idc() const { return header() >> 5 & 0x3; }

 private:
  [[nodiscard]] unsigned header() const { return std::to_integer<unsigned>(bytes[0]); }
};

/// Returns the NAL units of an Annex B byte stream in order. Leaves out bytes before the first
/// start code, empty units and trailing zero bytes.
std::vector<NalUnit> split_annex_b(std::span<const std::byte> stream);

/// Colour of the samples; defaults are what E.2.1 infers when the field is absent. Code points of
/// tables E-3 to E-5: 1 = BT.709, 2 = unspecified.
struct VideoSignal {
  bool full_range = false;
  int primaries = 2;
  int transfer = 2;
  int matrix = 2;
};

struct BitstreamRestriction {
  bool motion_vectors_over_pic_boundaries = true;
  unsigned max_bytes_per_pic_denom = 0;  // 0: no limit
  unsigned max_bits_per_mb_denom = 0;    // 0: no limit
  unsigned log2_max_mv_length_horizontal = 16;
  unsigned log2_max_mv_length_vertical = 16;
  unsigned max_num_reorder_frames = 0;
  unsigned max_dec_frame_buffering = 0;
};

struct Vui {
  std::optional<VideoSignal> video_signal;
  std::optional<unsigned> chroma_sample_loc_type;  // figure E-1; 0 = left
  bool fixed_frame_rate = false;
  bool has_hrd = false;
  std::optional<BitstreamRestriction> restriction;
};

/// The fields of an SPS that a sender or a decoder's set-up needs.
struct Sps {
  int profile_idc = 0;
  int constraint_flags = 0;  // the byte after profile_idc
  int level_idc = 0;         // 31 = level 3.1
  int max_num_ref_frames = 0;
  int frame_num_bits = 0;  // log2_max_frame_num: slice headers need it
  bool frame_mbs_only = true;
  glm::ivec2 size_px{0};  // after cropping
  std::optional<Vui> vui;
};

/// Reads an SPS NAL unit (7.3.2.1.1, E.1.1).
std::optional<Sps> parse_sps(NalUnit sps);

/// Returns the SPS with max_num_reorder_frames = 0 in its bitstream_restriction. A decoder then
/// shows each frame at once instead of waiting for the deepest reordering that the level allows. A
/// VUI without other facts is added if needed; all bits before the restriction stay. Only valid for
/// streams without B-frames.
std::optional<std::vector<std::byte>> with_zero_reorder_frames(NalUnit sps);

/// "avc1.PPCCLL" (RFC 6381): profile, constraint flags and level in hexadecimal.
std::string codec_string(const Sps& sps);

}  // namespace catgs::h264
