#pragma once

#include <memory>
#include <optional>
#include <string>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/dict.h>
#include <libavutil/frame.h>
}

namespace catgs::libav {

// Owning pointers for libav's objects, and its log and error texts.

struct Deleter {
  void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};
using CodecContext = std::unique_ptr<AVCodecContext, Deleter>;
using Frame = std::unique_ptr<AVFrame, Deleter>;
using Packet = std::unique_ptr<AVPacket, Deleter>;

/// Make empty objects. They throw std::bad_alloc if libav returns null.
CodecContext make_context(const AVCodec& codec);
Frame make_frame();
Packet make_packet();

/// Options for avcodec_open2.
class Options {
 public:
  Options() = default;
  ~Options() { av_dict_free(&dictionary_); }
  Options(const Options&) = delete;
  Options& operator=(const Options&) = delete;

  void set(const char* key, const char* value);
  [[nodiscard]] AVDictionary** raw() { return &dictionary_; }
  /// The first unused option. After avcodec_open2, it is one that the codec does not know.
  [[nodiscard]] std::string first_unused() const;

 private:
  AVDictionary* dictionary_ = nullptr;
};

/// Throws InputError if this libavcodec lacks the encoder.
const AVCodec& find_encoder(const char* name);

/// Calls avcodec_open2. Throws InputError with libav's reason, or for an unknown option.
void open(AVCodecContext& context, const AVCodec& codec, Options& options);

/// Collects the errors that libav logs on this thread, so that they appear in our message instead
/// of on stderr. The first LogCapture silences libav's own output for the whole process.
class LogCapture {
 public:
  LogCapture();
  ~LogCapture();
  LogCapture(const LogCapture&) = delete;
  LogCapture& operator=(const LogCapture&) = delete;

  /// The logged errors, or else the meaning of `error_code`.
  [[nodiscard]] std::string explain(int error_code) const;
  /// The mean quantiser of the picture that libx264 encoded last. Only its log tells it: packets
  /// have the planned one. Nothing from other encoders.
  [[nodiscard]] std::optional<double> quantiser() const { return quantiser_; }

 private:
  static void on_message(void* object, int level, const char* format, va_list arguments);

  static thread_local LogCapture* active_;
  LogCapture* outer_;
  std::string text_;
  std::optional<double> quantiser_;
};

}  // namespace catgs::libav
