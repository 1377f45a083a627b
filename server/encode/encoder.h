#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/frame/renderer.h"

namespace catgs {

enum class Codec { h264, mjpeg };

enum class EncoderKind { automatic, nvenc, x264, jpeg };

/// The libavcodec name of an encoder: "h264_nvenc", "libx264", "mjpeg"; or "automatic".
std::string_view encoder_name(EncoderKind kind);

inline constexpr int min_encoded_side_px = 16;
inline constexpr int max_encoded_side_px = 8192;
inline constexpr int max_encoded_fps = 240;
inline constexpr int max_encoder_threads = 64;
/// Slices share a picture's bits out before they are encoded, and a VBV of one frame has none to
/// spare. Two use nearly as much of the rate as one; four and eight leave 26 and 59 % of it unused
/// (1920x1080, 8 Mbit/s).
inline constexpr int max_h264_slices = 2;
inline constexpr int min_bitrate_kbps = 100;
inline constexpr int max_bitrate_kbps = 200000;

/// Adaptive quantisation moves bits from edges to flat blocks. With libx264's own default of 1,
/// edges are ragged and PSNR is 0.7 to 0.9 dB lower than without. With half of that strength,
/// scaled to each picture, PSNR is 0.1 dB lower and SSIM is best.
inline constexpr double default_aq_strength = 0.5;
inline constexpr double max_aq_strength = 2.0;

struct EncoderSettings {
  glm::ivec2 size_px{0};  // even sides, 16…8192; h264: within a level (8192x4320, not 8192x8192)
  int fps = 60;           // 1…240, nominal: sizes the one-frame VBV, says the level
  int bitrate_kbps = 8000;  // 100…200000; h264: cap; mjpeg picks its quality to stay near it
  int threads = 1;          // 1…64, encoder-internal; h264: as many slices, two at most
  // "ultrafast", "ultrafast-subpel", "superfast" … "medium"; see effort_presets for what they cost.
  std::string x264_preset = "superfast";
  double aq_strength = default_aq_strength;  // 0…2, of libx264 from superfast on; 0: none

  bool operator==(const EncoderSettings&) const = default;
};

/// One encoded frame. H.264: an Annex B access unit, SPS and PPS in front of every IDR.
/// MJPEG: one JPEG file.
struct EncodedFrame {
  std::vector<std::byte> bytes;
  bool idr = false;
  bool sharp = false;  // another pass over the same picture would show no difference
};

struct EncodeStatus {
  bool ok = true;
  std::string message;  // names encoder and cause; empty when ok
};

/// A live encoder: one frame in, one frame out, no delay, no B-frames. Not thread-safe; one per
/// session.
class Encoder {
 public:
  virtual ~Encoder() = default;
  Encoder() = default;
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;

  /// `frame` is i420 of the settings' size in host memory. The first frame is an IDR in any case.
  /// `out.bytes` is reused: its capacity survives from call to call.
  virtual EncodeStatus encode(const FrameView& frame, bool force_idr,
                              EncodedFrame& out) noexcept = 0;

  /// Limits frames to bitrate / fps from the next one on, without an IDR. `fps` is the rate that
  /// the session really reaches, 1…settings.fps. A slower session gets more bits a frame. The
  /// bitrate is clamped between 100 kbit/s and the maximum of the stream's level (h264: at least
  /// the bitrate it was opened with).
  virtual void set_rate(int bitrate_kbps, int fps) noexcept = 0;

  [[nodiscard]] virtual Codec codec() const = 0;
  [[nodiscard]] virtual std::string_view name() const = 0;  // "libx264", "mjpeg", "h264_nvenc"
  /// The codec string for WebCodecs: "avc1.PPCCLL" of the real bitstream, known from the start;
  /// empty for MJPEG.
  [[nodiscard]] virtual std::string codec_string() const = 0;
};

/// The result of a start-up probe, which encodes a few frames.
struct EncoderProbe {
  EncoderKind kind = EncoderKind::x264;
  std::string name;
  bool usable = false;
  std::string reason;  // why it is usable or not, for people: "no NVIDIA driver (libcuda.so.1)"
};

/// Tries every encoder, best first. Takes tens of milliseconds; call it once.
std::vector<EncoderProbe> probe_encoders();

/// Throws InputError when the encoder cannot be opened with these settings. `kind` is concrete.
std::unique_ptr<Encoder> make_encoder(EncoderKind kind, const EncoderSettings& settings);

}  // namespace catgs
