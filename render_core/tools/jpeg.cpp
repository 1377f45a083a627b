#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include <fmt/format.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/pixdesc.h>
}

#include "render_core/base/error.h"
#include "render_core/renderer.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/tools/picture.h"

namespace catgs {
namespace {

constexpr std::uint64_t max_file_bytes = std::uint64_t{256} << 20;

struct FreeContext {
  void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
};
struct FreeFrame {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
};
struct FreePacket {
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};
using Frame = std::unique_ptr<AVFrame, FreeFrame>;

/// A plane that may have fewer samples than the picture has pixels.
struct SampledPlane {
  const std::uint8_t* data;
  int stride;
  glm::ivec2 size;
  glm::ivec2 log2_step;  // pixels per sample

  /// The value at a pixel's centre, linear between the samples' centres.
  [[nodiscard]] float at(int x, int y) const {
    const auto [x0, x1, across] = between(x, log2_step.x, size.x);
    const auto [y0, y1, down] = between(y, log2_step.y, size.y);
    return std::lerp(std::lerp(value(x0, y0), value(x1, y0), across),
                     std::lerp(value(x0, y1), value(x1, y1), across), down);
  }

 private:
  struct Place {
    int first, second;
    float share;  // of the second
  };
  static Place between(int pixel, int log2_step, int count) {
    if (log2_step == 0) return {pixel, pixel, 0.0f};
    const float place =
        (static_cast<float>(pixel) + 0.5f) / static_cast<float>(1 << log2_step) - 0.5f;
    const float first = std::floor(place);
    const int index = static_cast<int>(first);
    return {std::clamp(index, 0, count - 1), std::clamp(index + 1, 0, count - 1), place - first};
  }
  [[nodiscard]] float value(int x, int y) const {
    return static_cast<float>(data[static_cast<std::ptrdiff_t>(stride) * y + x]);
  }
};

Image to_rgb(const AVFrame& frame, const AVPixFmtDescriptor& format) {
  const auto plane = [&](int i) {
    const glm::ivec2 step =
        i == 0 ? glm::ivec2(0) : glm::ivec2(format.log2_chroma_w, format.log2_chroma_h);
    const glm::ivec2 size{-((-frame.width) >> step.x), -((-frame.height) >> step.y)};
    return SampledPlane{frame.data[i], frame.linesize[i], size, step};
  };
  const bool grey = format.nb_components == 1;
  const SampledPlane luma = plane(0), blue = plane(grey ? 0 : 1), red = plane(grey ? 0 : 2);
  Image image{{frame.width, frame.height}, {}};
  image.rgb.reserve(static_cast<std::size_t>(frame.width) * frame.height * 3);
  const auto add = [&](float value) {
    image.rgb.push_back(std::clamp(std::round(value), 0.0f, 255.0f) / 255.0f);
  };
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      const float l = luma.at(x, y);
      const float b = grey ? 0.0f : blue.at(x, y) - 128.0f;
      const float r = grey ? 0.0f : red.at(x, y) - 128.0f;
      add(l + 1.402f * r);  // BT.601 over the full range, as JFIF has it
      add(l - 0.344136f * b - 0.714136f * r);
      add(l + 1.772f * b);
    }
  }
  return image;
}

/// The first picture of the bytes; null where they hold none that is whole.
Frame decode(const std::vector<std::byte>& bytes) {
  const AVCodec* codec = avcodec_find_decoder(AV_CODEC_ID_MJPEG);
  const std::unique_ptr<AVCodecContext, FreeContext> context(avcodec_alloc_context3(codec));
  const std::unique_ptr<AVPacket, FreePacket> packet(av_packet_alloc());
  Frame frame(av_frame_alloc());
  if (codec == nullptr || !context || !packet || !frame) return nullptr;
  context->thread_count = 1;
  context->max_pixels = std::int64_t{max_image_side_px} * max_image_side_px;
  context->err_recognition = AV_EF_BITSTREAM | AV_EF_BUFFER | AV_EF_EXPLODE;
  if (av_new_packet(packet.get(), static_cast<int>(bytes.size())) < 0) return nullptr;
  std::memcpy(packet->data, bytes.data(), bytes.size());
  const bool decoded = avcodec_open2(context.get(), codec, nullptr) >= 0 &&
                       avcodec_send_packet(context.get(), packet.get()) >= 0 &&
                       avcodec_receive_frame(context.get(), frame.get()) >= 0;
  if (!decoded || frame->decode_error_flags != 0) return nullptr;
  return frame;
}

}  // namespace

Image read_jpeg(const std::filesystem::path& path) {
  av_log_set_level(AV_LOG_QUIET);
  const std::vector<std::byte> bytes = FileSource(path).read_all(max_file_bytes);
  // The decoder takes a missing end for an end.
  const std::byte end[] = {std::byte{0xff}, std::byte{0xd9}};
  const bool whole = std::ranges::find_end(bytes, end).size() == std::size(end);
  const Frame frame = whole ? decode(bytes) : nullptr;
  if (!frame) {
    throw InputError(path.string(), "", "is damaged, or no JPEG that can be read",
                     fmt::format("at most {0}x{0} pixels", max_image_side_px));
  }
  const AVPixFmtDescriptor* format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame->format));
  const bool known = format != nullptr && (format->flags & AV_PIX_FMT_FLAG_RGB) == 0 &&
                     (format->nb_components == 1 || format->nb_components == 3) &&
                     format->comp[0].depth == 8;
  if (!known || std::max(frame->width, frame->height) > max_image_side_px) {
    throw InputError(path.string(), "", "is no JPEG of a camera",
                     fmt::format("8 bits, grey or YCbCr, at most {} pixels per side; or a PNG",
                                 max_image_side_px));
  }
  return to_rgb(*frame, *format);
}

}  // namespace catgs
