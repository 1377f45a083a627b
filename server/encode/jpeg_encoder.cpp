#include "server/encode/jpeg_encoder.h"

#include <algorithm>
#include <exception>
#include <span>
#include <string>
#include <utility>

#include "render_core/base/error.h"
#include "server/encode/encoder_input.h"
#include "server/encode/jpeg_color.h"
#include "server/encode/jpeg_rate.h"
#include "server/encode/libav.h"

namespace catgs {

namespace {

class LibavJpegEncoder final : public Encoder {
 public:
  LibavJpegEncoder(libav::CodecContext context, const EncoderSettings& settings)
      : context_(std::move(context)),
        input_(libav::make_frame()),
        packet_(libav::make_packet()),
        size_px_(settings.size_px),
        rate_(static_cast<std::size_t>(size_px_.x) * static_cast<std::size_t>(size_px_.y)) {
    rate_.set_budget(settings.bitrate_kbps, settings.fps);
    input_->format = context_->pix_fmt;
    input_->width = size_px_.x;
    input_->height = size_px_.y;
    if (av_frame_get_buffer(input_.get(), 0) < 0) throw std::bad_alloc();
  }

  EncodeStatus encode(const FrameView& frame, bool /*force_idr*/,
                      EncodedFrame& out) noexcept override {
    try {
      if (const std::string fault = input_fault(frame, size_px_); !fault.empty()) {
        return {false, std::string(name()) + ": " + fault};
      }
      convert(frame);
      return submit(out);
    } catch (const std::exception& error) {
      return {false, std::string(name()) + ": " + error.what()};
    }
  }

  void set_rate(int bitrate_kbps, int fps) noexcept override {
    rate_.set_budget(std::clamp(bitrate_kbps, min_bitrate_kbps, max_bitrate_kbps),
                     std::clamp(fps, 1, context_->time_base.den));
  }

  [[nodiscard]] Codec codec() const override { return Codec::mjpeg; }
  [[nodiscard]] std::string_view name() const override { return context_->codec->name; }
  [[nodiscard]] std::string codec_string() const override { return {}; }

 private:
  void convert(const FrameView& frame) {
    // libav may still hold the last picture: then it gets another buffer.
    if (av_frame_make_writable(input_.get()) < 0) throw std::bad_alloc();
    Yuv420Planes video;
    Yuv420Planes jfif;
    for (std::size_t i = 0; i < frame.planes.size(); ++i) {
      video.data[i] = reinterpret_cast<std::uint8_t*>(frame.planes[i].data);
      video.stride_bytes[i] = static_cast<std::ptrdiff_t>(frame.planes[i].stride_bytes);
      jfif.data[i] = input_->data[i];
      jfif.stride_bytes[i] = input_->linesize[i];
    }
    video_to_jfif(video, jfif, size_px_);
  }

  EncodeStatus submit(EncodedFrame& out) {
    const int qscale = rate_.qscale();
    input_->quality = qscale * FF_QP2LAMBDA;
    input_->pts = next_pts_++;
    const libav::LogCapture log;
    int result = avcodec_send_frame(context_.get(), input_.get());
    if (result >= 0) result = avcodec_receive_packet(context_.get(), packet_.get());
    if (result < 0) return {false, std::string(name()) + ": " + log.explain(result)};
    const auto bytes =
        std::as_bytes(std::span(packet_->data, static_cast<std::size_t>(packet_->size)));
    out.bytes.assign(bytes.begin(), bytes.end());
    out.idr = true;
    out.sharp = qscale <= JpegRateControl::sharp_qscale;
    av_packet_unref(packet_.get());
    rate_.update(qscale, out.bytes.size());
    return {};
  }

  libav::CodecContext context_;
  libav::Frame input_;
  libav::Packet packet_;
  glm::ivec2 size_px_;
  JpegRateControl rate_;
  std::int64_t next_pts_ = 0;
};

}  // namespace

std::unique_ptr<Encoder> make_jpeg_encoder(const EncoderSettings& settings) {
  const AVCodec& codec = libav::find_encoder("mjpeg");
  libav::CodecContext context = libav::make_context(codec);
  context->width = settings.size_px.x;
  context->height = settings.size_px.y;
  context->pix_fmt = AV_PIX_FMT_YUVJ420P;
  context->color_range = AVCOL_RANGE_JPEG;
  context->sample_aspect_ratio = {1, 1};  // without it libavcodec writes no JFIF header
  context->time_base = {1, settings.fps};
  context->thread_count = settings.threads;
  context->thread_type = FF_THREAD_SLICE;  // frame threads would each hold back a frame
  context->flags |= AV_CODEC_FLAG_QSCALE;  // each frame brings its own quantiser
  context->global_quality = FF_QP2LAMBDA;
  libav::Options options;
  options.set("huffman",
              "default");  // optimal tables cost a second pass for about 5 % of the bytes
  libav::open(*context, codec, options);
  return std::make_unique<LibavJpegEncoder>(std::move(context), settings);
}

}  // namespace catgs
