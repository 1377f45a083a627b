#include "server/encode/libav.h"

#include <array>
#include <charconv>
#include <cstdarg>
#include <cstdio>
#include <mutex>
#include <new>
#include <string_view>

extern "C" {
#include <libavutil/error.h>
#include <libavutil/log.h>
}

#include "render_core/base/error.h"

namespace catgs::libav {

namespace {

template <class T>
T* checked(T* object) {
  if (object == nullptr) throw std::bad_alloc();
  return object;
}

constexpr std::size_t max_captured_bytes = 1000;  // a codec may log the same error per macroblock

std::optional<double> number_after(std::string_view text, std::string_view name) {
  const std::size_t at = text.find(name);
  if (at == std::string_view::npos) return std::nullopt;
  text.remove_prefix(at + name.size());
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() ? std::optional(number) : std::nullopt;
}

}  // namespace

CodecContext make_context(const AVCodec& codec) {
  return CodecContext(checked(avcodec_alloc_context3(&codec)));
}

Frame make_frame() { return Frame(checked(av_frame_alloc())); }

Packet make_packet() { return Packet(checked(av_packet_alloc())); }

void Options::set(const char* key, const char* value) {
  if (av_dict_set(&dictionary_, key, value, 0) < 0) throw std::bad_alloc();
}

std::string Options::first_unused() const {
  const AVDictionaryEntry* entry = av_dict_get(dictionary_, "", nullptr, AV_DICT_IGNORE_SUFFIX);
  return entry == nullptr ? std::string() : std::string(entry->key);
}

const AVCodec& find_encoder(const char* name) {
  const AVCodec* codec = avcodec_find_encoder_by_name(name);
  if (codec == nullptr) {
    throw InputError(name, "", std::string("libavcodec was built without ") + name,
                     "install a build that has it, or choose another encoder");
  }
  return *codec;
}

void open(AVCodecContext& context, const AVCodec& codec, Options& options) {
  const LogCapture log;
  const int result = avcodec_open2(&context, &codec, options.raw());
  if (result < 0) throw InputError(codec.name, "", "cannot open: " + log.explain(result));
  if (const std::string unused = options.first_unused(); !unused.empty()) {
    throw InputError(codec.name, "option " + unused, "unknown to this libavcodec");
  }
}

thread_local LogCapture* LogCapture::active_ = nullptr;

LogCapture::LogCapture() : outer_(active_) {
  static std::once_flag installed;
  std::call_once(installed, [] { av_log_set_callback(&LogCapture::on_message); });
  active_ = this;
}

LogCapture::~LogCapture() { active_ = outer_; }

void LogCapture::on_message(void* /*object*/, int level, const char* format, va_list arguments) {
  if (active_ == nullptr) return;
  const bool of_picture = level == AV_LOG_DEBUG && std::string_view(format).starts_with("frame=");
  if (level > AV_LOG_ERROR && !of_picture) return;
  std::array<char, 512> line{};
  std::vsnprintf(line.data(), line.size(), format, arguments);
  if (of_picture) {
    active_->quantiser_ = number_after(line.data(), " QP=");
    return;
  }
  std::string_view text(line.data());
  while (!text.empty() && (text.back() == '\n' || text.back() == '.')) text.remove_suffix(1);
  std::string& all = active_->text_;
  if (text.empty() || all.size() + text.size() > max_captured_bytes) return;
  if (!all.empty()) all += "; ";
  all += text;
}

std::string LogCapture::explain(int error_code) const {
  if (!text_.empty()) return text_;
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(error_code, text.data(), text.size());
  return text.data();
}

}  // namespace catgs::libav
