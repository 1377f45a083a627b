#include <array>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include <dlfcn.h>

#include "server/encode/encoder.h"

namespace catgs {

namespace {

bool loads(const char* library) {
  void* handle = dlopen(library, RTLD_LAZY | RTLD_LOCAL);
  if (handle == nullptr) return false;
  dlclose(handle);
  return true;
}

/// Finds the missing part for the message, because libavcodec only says that NVENC could not be
/// opened.
std::string nvenc_failure(const std::string& libav_reason) {
  if (!loads("libcuda.so.1")) return "no NVIDIA driver: libcuda.so.1 not found";
  if (!loads("libnvidia-encode.so.1")) {
    return "NVIDIA driver without its video part: libnvidia-encode.so.1 not found (in a container, "
           "NVIDIA_DRIVER_CAPABILITIES must include video)";
  }
  return "driver present, but no GPU here has a usable NVENC engine: " + libav_reason;
}

/// Encodes a grey frame a few times, which exercises every part of an encoder.
void encode_some(Encoder& encoder, glm::ivec2 size_px) {
  const auto width = static_cast<std::size_t>(size_px.x);
  std::vector<std::byte> grey(width * static_cast<std::size_t>(size_px.y), std::byte{128});
  FrameView frame;
  frame.format = PixelFormat::i420;
  frame.size_px = size_px;
  frame.planes = {Plane{grey.data(), width}, Plane{grey.data(), width / 2},
                  Plane{grey.data(), width / 2}};
  EncodedFrame encoded;
  for (int i = 0; i < 3; ++i) {
    const EncodeStatus status = encoder.encode(frame, i == 2, encoded);
    if (!status.ok) throw std::runtime_error(status.message);
  }
}

EncoderProbe probe(EncoderKind kind) {
  EncoderProbe result{kind, std::string(encoder_name(kind)), false, {}};
  EncoderSettings settings;
  settings.size_px = {320, 192};  // NVENC takes no less than 145x49
  try {
    encode_some(*make_encoder(kind, settings), settings.size_px);
    result.usable = true;
    result.reason = "encoded a test picture";
  } catch (const std::exception& error) {
    result.reason = kind == EncoderKind::nvenc ? nvenc_failure(error.what()) : error.what();
  }
  return result;
}

}  // namespace

std::vector<EncoderProbe> probe_encoders() {
  std::vector<EncoderProbe> probes;
  for (const EncoderKind kind : {EncoderKind::nvenc, EncoderKind::x264, EncoderKind::jpeg}) {
    probes.push_back(probe(kind));
  }
  return probes;
}

}  // namespace catgs
