#include "server/encode/encoder_input.h"

#include <fmt/format.h>

#include "render_core/base/error.h"

namespace catgs {

namespace {

void check_range(std::string_view encoder, std::string_view setting, int value, int lowest,
                 int highest) {
  if (value >= lowest && value <= highest) return;
  throw InputError(encoder, fmt::format("{} {}", setting, value), "out of range",
                   fmt::format("{} to {}", lowest, highest));
}

}  // namespace

void check_settings(std::string_view encoder, const EncoderSettings& settings) {
  const glm::ivec2 size = settings.size_px;
  check_range(encoder, "width", size.x, min_encoded_side_px, max_encoded_side_px);
  check_range(encoder, "height", size.y, min_encoded_side_px, max_encoded_side_px);
  if (size.x % 2 != 0 || size.y % 2 != 0) {
    throw InputError(encoder, fmt::format("size {}x{}", size.x, size.y), "odd side",
                     "4:2:0 video needs even sides");
  }
  check_range(encoder, "frame rate", settings.fps, 1, max_encoded_fps);
  check_range(encoder, "bitrate in kbit/s", settings.bitrate_kbps, min_bitrate_kbps,
              max_bitrate_kbps);
  check_range(encoder, "threads", settings.threads, 1, max_encoder_threads);
}

std::string input_fault(const FrameView& frame, glm::ivec2 size_px) {
  if (frame.format != PixelFormat::i420) return "the frame is not i420";
  if (frame.space != MemorySpace::host) return "the frame is not in host memory";
  if (frame.size_px != size_px) {
    return fmt::format("the frame is {}x{}, the encoder was opened for {}x{}", frame.size_px.x,
                       frame.size_px.y, size_px.x, size_px.y);
  }
  for (std::size_t i = 0; i < frame.planes.size(); ++i) {
    const auto width = static_cast<std::size_t>(i == 0 ? size_px.x : size_px.x / 2);
    if (frame.planes[i].data == nullptr) return fmt::format("plane {} is missing", i);
    if (frame.planes[i].stride_bytes < width) {
      return fmt::format("plane {}: stride {} is less than its width {}", i,
                         frame.planes[i].stride_bytes, width);
    }
  }
  return {};
}

}  // namespace catgs
