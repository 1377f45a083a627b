#include "server/encode/encoder.h"

#include "render_core/base/error.h"
#include "server/encode/encoder_input.h"
#include "server/encode/h264_encoder.h"
#include "server/encode/jpeg_encoder.h"

namespace catgs {

std::string_view encoder_name(EncoderKind kind) {
  switch (kind) {
    case EncoderKind::nvenc:
      return "h264_nvenc";
    case EncoderKind::x264:
      return "libx264";
    case EncoderKind::jpeg:
      return "mjpeg";
    case EncoderKind::automatic:
      break;
  }
  return "automatic";
}

std::unique_ptr<Encoder> make_encoder(EncoderKind kind, const EncoderSettings& settings) {
  check_settings(encoder_name(kind), settings);
  switch (kind) {
    case EncoderKind::nvenc:
      return make_nvenc_encoder(settings);
    case EncoderKind::x264:
      return make_x264_encoder(settings);
    case EncoderKind::jpeg:
      return make_jpeg_encoder(settings);
    case EncoderKind::automatic:
      break;
  }
  throw InputError("encoder", "automatic", "is not an encoder", "choose one that a probe found");
}

}  // namespace catgs
