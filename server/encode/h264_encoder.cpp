#include "server/encode/h264_encoder.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "server/encode/encoder_input.h"
#include "server/encode/h264_bitstream.h"
#include "server/encode/h264_level.h"
#include "server/encode/libav.h"

namespace catgs {

namespace {

// The quantiser of a sharp picture, of 0 to 51. Rendered scenes then have 48 to 51 dB. libx264 goes
// no finer: a still ends with the same picture at any rate and with any slices.
constexpr int sharp_quantiser = 16;
constexpr double sharp_mean = sharp_quantiser + 0.25;  // a few blocks may be coarser
constexpr double coarsest_quantiser = 51.0;

/// An encoder is asked for this much, so that its frames take the session's bits.
struct RateMargins {
  double rate = 1.0;  // in sessions' rates
  double vbv = 1.0;   // in frames of that rate
};
// libx264 uses 90 % of the rate that it is asked for in one slice, and 87 % in two. One of two
// slices may wait for a processor, and they misjudge each other's size. In a full VBV the later one
// then ended in blocks of the coarsest quantiser, in a frame of 1,400 on a busy machine. From 1.1
// frames on, libx264 controls its rate in another way and uses 60 %.
constexpr double longest_vbv = 1.09;
constexpr RateMargins one_slice{1.05, 1.0};
constexpr RateMargins two_slices{1.07, longest_vbv};

/// A VBV of about one frame interval, so that no frame takes much longer on a link of this bitrate.
/// The encoder counts time at its nominal rate. A slower session gets a higher bitrate per nominal
/// second, for the same bits per real second.
void apply_rate(AVCodecContext& context, int bitrate_kbps, int fps, const RateMargins& margins) {
  // libavcodec hands whole kbit to x264, which takes a VBV of 0 for none. At low rates the bitrate
  // grows with the rounded VBV, within a bound: a link may carry no more. A VBV that would then be
  // too long for the rate is rounded down, and the rate with it.
  constexpr double most_rounded = 1.2;
  const double frame_kbit = margins.rate * bitrate_kbps / fps;
  const double most_kbit = most_rounded * bitrate_kbps / fps;
  double vbv_kbit = std::max(std::ceil(frame_kbit), std::floor(margins.vbv * frame_kbit));
  if (vbv_kbit > longest_vbv * most_kbit) vbv_kbit = std::max(1.0, std::floor(frame_kbit));
  const double rounded_kbit = std::max(frame_kbit, std::min(vbv_kbit / margins.vbv, most_kbit));
  const double nominal_kbps = std::min(std::min(rounded_kbit, vbv_kbit) * context.framerate.num,
                                       2e6);  // the most that x264 accepts
  context.bit_rate = std::llround(nominal_kbps) * 1000;
  context.rc_max_rate = context.bit_rate;
  context.rc_buffer_size = static_cast<int>(vbv_kbit) * 1000;
}

/// The settings common to all H.264 encoders.
void apply_common(AVCodecContext& context, const EncoderSettings& settings, int level_idc,
                  const RateMargins& margins) {
  context.width = settings.size_px.x;
  context.height = settings.size_px.y;
  context.pix_fmt = AV_PIX_FMT_YUV420P;
  context.time_base = {1, settings.fps};
  context.framerate = {settings.fps, 1};
  context.color_primaries = AVCOL_PRI_BT709;
  context.color_trc = AVCOL_TRC_BT709;
  context.colorspace = AVCOL_SPC_BT709;
  context.color_range = AVCOL_RANGE_MPEG;
  context.chroma_sample_location = AVCHROMA_LOC_CENTER;  // renderers average 2x2 pixels
  context.level = level_idc;
  context.max_b_frames = 0;
  context.gop_size = std::numeric_limits<int>::max();  // an IDR only when asked for
  // Parameter sets come with the open encoder instead of inside its packets: they are then known,
  // and corrected, before the first frame.
  context.flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  apply_rate(context, settings.bitrate_kbps, settings.fps, margins);
}

/// The mean quantiser of a packet's picture, as its encoder reports it; the coarsest where it does
/// not.
double reported_quantiser(const AVPacket& packet) {
  std::size_t size = 0;
  const std::uint8_t* stats = av_packet_get_side_data(&packet, AV_PKT_DATA_QUALITY_STATS, &size);
  if (stats == nullptr || size < 4) return coarsest_quantiser;
  const std::uint32_t lambda =
      stats[0] | stats[1] << 8 | stats[2] << 16 | static_cast<std::uint32_t>(stats[3]) << 24;
  return static_cast<double>(lambda) / FF_QP2LAMBDA;
}

void append(std::vector<std::byte>& to, std::span<const std::byte> bytes) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// Returns the SPS and PPS of an open encoder as an Annex B stream. Each SPS says that frames come
/// in order. `codec_string` gets the SPS's codec string.
std::vector<std::byte> read_parameter_sets(const AVCodecContext& context, const char* name,
                                           std::string& codec_string) {
  constexpr std::byte start_code[] = {std::byte{0}, std::byte{0}, std::byte{0}, std::byte{1}};
  const std::span header(reinterpret_cast<const std::byte*>(context.extradata),
                         static_cast<std::size_t>(std::max(context.extradata_size, 0)));
  std::vector<std::byte> sets;
  for (const h264::NalUnit& unit : h264::split_annex_b(header)) {
    if (unit.type() == h264::NalType::sps) {
      const auto sps = h264::parse_sps(unit);
      const auto rewritten = h264::with_zero_reorder_frames(unit);
      if (!sps || !rewritten) break;
      codec_string = h264::codec_string(*sps);
      append(sets, start_code);
      append(sets, *rewritten);
    } else if (unit.type() == h264::NalType::pps) {
      append(sets, start_code);
      append(sets, unit.bytes);
    }
  }
  if (codec_string.empty()) throw InputError(name, "SPS", "the encoder gave none that can be read");
  return sets;
}

class LibavH264Encoder final : public Encoder {
 public:
  LibavH264Encoder(libav::CodecContext context, const EncoderSettings& settings, int level_idc,
                   const RateMargins& margins)
      : context_(std::move(context)),
        input_(libav::make_frame()),
        packet_(libav::make_packet()),
        size_px_(settings.size_px),
        margins_(margins),
        max_bitrate_kbps_(h264::level_max_bitrate_kbps(level_idc).value()) {
    parameter_sets_ = read_parameter_sets(*context_, context_->codec->name, codec_string_);
  }

  EncodeStatus encode(const FrameView& frame, bool force_idr, EncodedFrame& out) noexcept override {
    try {
      if (const std::string fault = input_fault(frame, size_px_); !fault.empty()) {
        return {false, std::string(name()) + ": " + fault};
      }
      borrow(frame);
      input_->pts = next_pts_++;
      input_->pict_type = force_idr || input_->pts == 0 ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
      return submit(out);
    } catch (const std::exception& error) {
      return {false, std::string(name()) + ": " + error.what()};
    }
  }

  void set_rate(int bitrate_kbps, int fps) noexcept override {
    apply_rate(*context_, std::clamp(bitrate_kbps, min_bitrate_kbps, max_bitrate_kbps_),
               std::clamp(fps, 1, context_->framerate.num), margins_);
  }

  [[nodiscard]] Codec codec() const override { return Codec::h264; }
  [[nodiscard]] std::string_view name() const override { return context_->codec->name; }
  [[nodiscard]] std::string codec_string() const override { return codec_string_; }

 private:
  /// Lends the frame's planes to libav without a copy. Encoders without delay have released them
  /// when encode() returns.
  void borrow(const FrameView& frame) {
    av_frame_unref(input_.get());
    input_->format = context_->pix_fmt;
    input_->width = size_px_.x;
    input_->height = size_px_.y;
    for (std::size_t i = 0; i < frame.planes.size(); ++i) {
      const Plane& plane = frame.planes[i];
      const auto height = static_cast<std::size_t>(i == 0 ? size_px_.y : size_px_.y / 2);
      auto* data = reinterpret_cast<std::uint8_t*>(plane.data);
      input_->data[i] = data;
      input_->linesize[i] = static_cast<int>(plane.stride_bytes);
      input_->buf[i] = av_buffer_create(
          data, plane.stride_bytes * height, [](void*, std::uint8_t*) {}, nullptr,
          AV_BUFFER_FLAG_READONLY);
      if (input_->buf[i] == nullptr) throw std::bad_alloc();
    }
  }

  EncodeStatus submit(EncodedFrame& out) {
    const libav::LogCapture log;
    int result = avcodec_send_frame(context_.get(), input_.get());
    if (result >= 0) result = avcodec_receive_packet(context_.get(), packet_.get());
    av_frame_unref(input_.get());
    if (result < 0) return {false, std::string(name()) + ": " + log.explain(result)};
    out.idr = (packet_->flags & AV_PKT_FLAG_KEY) != 0;
    out.sharp = is_sharp(log.quantiser());
    out.bytes.clear();
    if (out.idr) append(out.bytes, parameter_sets_);
    append(out.bytes,
           std::as_bytes(std::span(packet_->data, static_cast<std::size_t>(packet_->size))));
    av_packet_unref(packet_.get());
    return {};
  }

  /// Whether the packet's picture is sharp. Its mean quantiser may be known.
  [[nodiscard]] bool is_sharp(std::optional<double> quantiser) const {
    const double planned = reported_quantiser(*packet_);
    // libx264 may stay one above its plan. Less than a bit per macroblock codes nothing any more.
    const int macroblocks = (size_px_.x + 15) / 16 * ((size_px_.y + 15) / 16);
    const bool finished = planned <= sharp_quantiser && 8 * packet_->size < macroblocks;
    return finished || quantiser.value_or(planned) <= sharp_mean;
  }

  libav::CodecContext context_;
  libav::Frame input_;
  libav::Packet packet_;
  glm::ivec2 size_px_;
  RateMargins margins_;
  int max_bitrate_kbps_;  // of the level that the SPS names
  std::int64_t next_pts_ = 0;
  std::string codec_string_;
  std::vector<std::byte> parameter_sets_;
};

struct X264Preset {
  std::string_view name;        // ours
  const char* base;             // libx264's
  const char* parameters = "";  // that differ from it, as --x264-params
};

/// Slower presets than medium are no use live.
constexpr X264Preset x264_presets[] = {
    {"ultrafast", "ultrafast"},
    // A moving camera shifts pictures by fractions of a pixel, and ultrafast has no sub-pixel
    // motion vectors. They gain 3 to 4 dB for 1.4 times its work.
    {"ultrafast-subpel", "ultrafast", "subme=1:deblock=0,0"},
    {"superfast", "superfast"},
    {"veryfast", "veryfast"},
    {"faster", "faster"},
    {"fast", "fast"},
    {"medium", "medium"},
};

/// libx264 itself would complain on stderr.
const X264Preset& find_preset(const std::string& name) {
  std::string names;
  for (const X264Preset& preset : x264_presets) {
    if (preset.name == name) return preset;
    names.append(names.empty() ? "" : ", ").append(preset.name);
  }
  throw InputError("libx264", "preset " + name, "unknown", "one of " + names);
}

/// As --x264-params.
std::string parameters_of(const X264Preset& preset, double aq_strength) {
  if (std::string_view(preset.base) == "ultrafast") return preset.parameters;  // without any
  return aq_strength > 0.0 ? fmt::format("aq-mode=2:aq-strength={}", aq_strength) : "aq-mode=0";
}

int level_or_throw(const char* name, const EncoderSettings& settings) {
  const auto level = h264::level(settings.size_px, settings.fps, settings.bitrate_kbps);
  if (!level) {
    throw InputError(name,
                     "size " + std::to_string(settings.size_px.x) + "x" +
                         std::to_string(settings.size_px.y) + " at " +
                         std::to_string(settings.fps) + " fps",
                     "more than any H.264 level admits", "lower the size or the frame rate");
  }
  return *level;
}

}  // namespace

std::unique_ptr<Encoder> make_x264_encoder(const EncoderSettings& settings) {
  const AVCodec& codec = libav::find_encoder("libx264");
  const X264Preset& preset = find_preset(settings.x264_preset);
  const int level_idc = level_or_throw(codec.name, settings);
  libav::CodecContext context = libav::make_context(codec);
  const int slices = std::min(settings.threads, max_h264_slices);
  const RateMargins& margins = slices > 1 ? two_slices : one_slice;
  apply_common(*context, settings, level_idc, margins);
  context->thread_count = slices;
  context->thread_type = FF_THREAD_SLICE;  // frame threads would each hold back a frame
  context->qmin = sharp_quantiser;
  // An encoder begins with a full VBV. One of a frame at the nominal rate is too small for a
  // session that is slower: libx264 plans a first picture of its rate, and the later slice gets
  // nothing.
  context->rc_buffer_size = static_cast<int>(context->bit_rate);
  libav::Options options;
  options.set("preset", preset.base);
  options.set("x264-params", parameters_of(preset, settings.aq_strength).c_str());
  options.set("tune", "zerolatency");  // no look-ahead, no B-frames, constant frame rate
  options.set("forced-idr", "1");      // a requested key frame is an IDR
  options.set("sc_threshold", "0");    // no I-frames at scene cuts: a teleport is coded as P
  libav::open(*context, codec, options);
  apply_rate(*context, settings.bitrate_kbps, settings.fps, margins);
  return std::make_unique<LibavH264Encoder>(std::move(context), settings, level_idc, margins);
}

std::unique_ptr<Encoder> make_nvenc_encoder(const EncoderSettings& settings) {
  const AVCodec& codec = libav::find_encoder("h264_nvenc");
  const int level_idc = level_or_throw(codec.name, settings);
  libav::CodecContext context = libav::make_context(codec);
  apply_common(*context, settings, level_idc, {});
  libav::Options options;
  options.set("preset", "p3");
  options.set("tune", "ull");  // ultra low latency
  options.set("rc", "cbr");
  options.set("delay", "0");  // a frame in, its packet out
  options.set("zerolatency", "1");
  options.set("forced-idr", "1");
  options.set("no-scenecut", "1");
  libav::open(*context, codec, options);
  return std::make_unique<LibavH264Encoder>(std::move(context), settings, level_idc, RateMargins{});
}

}  // namespace catgs
