#include <cerrno>
#include <exception>
#include <memory>

#include <fmt/format.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
}

#include "render_core/base/error.h"
#include "render_core/video/video_file.h"

namespace catgs {
namespace {

template <auto free_function>
struct FreedByAddress {
  template <typename T>
  void operator()(T* object) const {
    free_function(&object);
  }
};
using CodecContext = std::unique_ptr<AVCodecContext, FreedByAddress<avcodec_free_context>>;
using Frame = std::unique_ptr<AVFrame, FreedByAddress<av_frame_free>>;
using Packet = std::unique_ptr<AVPacket, FreedByAddress<av_packet_free>>;

struct CloseOutput {
  void operator()(AVFormatContext* output) const {
    avio_closep(&output->pb);
    avformat_free_context(output);
  }
};
using Output = std::unique_ptr<AVFormatContext, CloseOutput>;

class Mp4File final : public VideoFile {
 public:
  explicit Mp4File(const VideoSettings& settings)
      : path_(settings.path),
        progress_(settings.progress),
        frame_(av_frame_alloc()),
        packet_(av_packet_alloc()) {
    AVFormatContext* output = nullptr;
    check(avformat_alloc_output_context2(&output, nullptr, "mp4", path_.c_str()), "open");
    output_.reset(output);
    output->interrupt_callback = {[](void* file) { return static_cast<Mp4File*>(file)->ends(); },
                                  this};
    open_encoder(settings);
    stream_ = avformat_new_stream(output, nullptr);
    if (stream_ == nullptr) check(AVERROR(ENOMEM), "open");
    stream_->time_base = encoder_->time_base;
    stream_->avg_frame_rate = encoder_->framerate;
    check(avcodec_parameters_from_context(stream_->codecpar, encoder_.get()), "open");
    check(avio_open2(&output->pb, path_.c_str(), AVIO_FLAG_WRITE, &output->interrupt_callback,
                     nullptr),
          "open");
    AVDictionary* options = nullptr;
    av_dict_set(&options, "movflags", "+faststart", 0);
    const int result = avformat_write_header(output, &options);
    av_dict_free(&options);
    check(result, "start");
  }

  void write(const FrameView& frame) override {
    frame_->format = encoder_->pix_fmt;
    frame_->width = frame.size_px.x;
    frame_->height = frame.size_px.y;
    frame_->pts = next_pts_++;
    for (int plane = 0; plane < 3; ++plane) {
      // Not reference-counted: the encoder copies the data that it keeps.
      frame_->data[plane] = reinterpret_cast<std::uint8_t*>(frame.planes[plane].data);
      frame_->linesize[plane] = static_cast<int>(frame.planes[plane].stride_bytes);
    }
    check(avcodec_send_frame(encoder_.get(), frame_.get()), "encode");
    write_packets();
  }

  void finish() override {
    check(avcodec_send_frame(encoder_.get(), nullptr), "encode");
    write_packets();
    check(av_write_trailer(output_.get()), "finish");
  }

 private:
  void open_encoder(const VideoSettings& settings) {
    const AVCodec* codec = avcodec_find_encoder_by_name("libx264");
    if (codec == nullptr) {
      throw InputError(path_, "", "this machine's libavcodec has no libx264", "write .y4m instead");
    }
    encoder_.reset(avcodec_alloc_context3(codec));
    encoder_->width = settings.size_px.x;
    encoder_->height = settings.size_px.y;
    encoder_->pix_fmt = AV_PIX_FMT_YUV420P;
    encoder_->framerate = av_d2q(settings.fps, 100'000);
    encoder_->time_base = av_inv_q(encoder_->framerate);
    encoder_->color_range = AVCOL_RANGE_MPEG;
    encoder_->colorspace = AVCOL_SPC_BT709;
    encoder_->color_primaries = AVCOL_PRI_BT709;
    encoder_->color_trc = AVCOL_TRC_BT709;
    encoder_->chroma_sample_location = AVCHROMA_LOC_CENTER;
    encoder_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    encoder_->thread_count = settings.threads;
    av_opt_set(encoder_->priv_data, "preset", "medium", 0);
    av_opt_set(encoder_->priv_data, "crf", "18", 0);
    check(avcodec_open2(encoder_.get(), codec, nullptr), "open libx264 for");
  }

  void write_packets() {
    while (true) {
      const int result = avcodec_receive_packet(encoder_.get(), packet_.get());
      if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
      check(result, "encode");
      packet_->duration = 1;
      packet_->stream_index = stream_->index;
      av_packet_rescale_ts(packet_.get(), encoder_->time_base, stream_->time_base);
      check(av_interleaved_write_frame(output_.get(), packet_.get()), "write");
      progress_();
    }
  }

  /// libavformat asks whether to give up. Exceptions must not pass through it: check() throws them.
  int ends() noexcept {
    try {
      if (!interruption_) progress_();
    } catch (...) {
      interruption_ = std::current_exception();
    }
    return interruption_ ? 1 : 0;
  }

  void check(int result, std::string_view action) const {
    if (interruption_) std::rethrow_exception(interruption_);
    if (result >= 0) return;
    char text[AV_ERROR_MAX_STRING_SIZE] = {};
    av_strerror(result, text, sizeof text);
    throw InputError(path_, "", fmt::format("cannot {} the video: {}", action, text));
  }

  std::string path_;
  const std::function<void()> progress_;
  std::exception_ptr interruption_;  // thrown by progress_
  Output output_;                    // asks ends() until it is closed
  CodecContext encoder_;
  Frame frame_;
  Packet packet_;
  AVStream* stream_ = nullptr;  // owned by output_
  std::int64_t next_pts_ = 0;
};

}  // namespace

std::unique_ptr<VideoFile> make_mp4_file(const VideoSettings& settings) {
  av_log_set_level(AV_LOG_ERROR);
  return std::make_unique<Mp4File>(settings);
}

}  // namespace catgs
