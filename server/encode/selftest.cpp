#include "server/encode/selftest.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <exception>
#include <ostream>
#include <string>

#include <fmt/format.h>

#include "server/encode/decoder.h"
#include "server/encode/encoder.h"
#include "server/encode/jpeg_color.h"
#include "server/encode/test_picture.h"

namespace catgs {

namespace {

struct Workload {
  glm::ivec2 size_px;
  int bitrate_kbps;
};
constexpr int fps = 60;
constexpr int frames = 30;
constexpr std::array<Workload, 3> workloads = {
    {{{640, 360}, 4000}, {{1280, 720}, 8000}, {{1920, 1080}, 16000}}};

// A sound encoder reaches 30 dB and more here; swapped planes, a wrong matrix or a lost reference
// stay far below.
constexpr double passing_psnr_db = 25;

struct Result {
  double mean_ms = 0;
  double worst_ms = 0;
  double bitrate_kbps = 0;
  double psnr_db = 0;  // luma of the last frame
  std::string stream;
  std::string fault;  // empty: passed
};

/// Luma as the decoder must give it back: JPEG changes matrix and range.
std::vector<std::uint8_t> expected_luma(I420Picture& picture, Codec codec) {
  if (codec == Codec::h264) return picture.planes[0];
  I420Picture jfif(picture.size_px);
  const auto planes_of = [](I420Picture& from) {
    Yuv420Planes planes;
    for (std::size_t i = 0; i < from.planes.size(); ++i) {
      planes.data[i] = from.planes[i].data();
      planes.stride_bytes[i] = i == 0 ? from.size_px.x : from.size_px.x / 2;
    }
    return planes;
  };
  video_to_jfif(planes_of(picture), planes_of(jfif), picture.size_px);
  return jfif.planes[0];
}

Result measure(EncoderKind kind, const Workload& workload) {
  using Clock = std::chrono::steady_clock;
  EncoderSettings settings;
  settings.size_px = workload.size_px;
  settings.fps = fps;
  settings.bitrate_kbps = workload.bitrate_kbps;
  const auto encoder = make_encoder(kind, settings);
  Decoder decoder(encoder->codec());
  Result result;
  EncodedFrame encoded;
  DecodedPicture decoded;
  std::size_t bytes = 0;
  for (int time = 0; time < frames; ++time) {
    I420Picture picture = moving_picture(workload.size_px, time);
    const Clock::time_point start = Clock::now();
    EncodeStatus status = encoder->encode(picture.view(), false, encoded);
    const double ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    if (status.ok) status = decoder.decode(encoded.bytes, decoded);
    if (!status.ok) {
      result.fault = fmt::format("frame {}: {}", time, status.message);
      return result;
    }
    result.mean_ms += ms / frames;
    result.worst_ms = std::max(result.worst_ms, ms);
    bytes += encoded.bytes.size();
    if (time + 1 == frames) {
      result.psnr_db = psnr(decoded.planes[0], expected_luma(picture, encoder->codec()));
    }
  }
  result.bitrate_kbps = static_cast<double>(bytes) * 8 * fps / frames / 1000;
  result.stream = encoder->codec() == Codec::h264 ? encoder->codec_string() : "JFIF";
  if (result.psnr_db < passing_psnr_db) {
    result.fault = fmt::format("decodes to another picture: {:.1f} dB", result.psnr_db);
  }
  return result;
}

/// Prints one row; returns whether it passed.
bool run_one(const EncoderProbe& probe, const Workload& workload, std::ostream& out) {
  const std::string size = fmt::format("{}x{}", workload.size_px.x, workload.size_px.y);
  Result result;
  try {
    result = measure(probe.kind, workload);
  } catch (const std::exception& error) {
    result.fault = error.what();
  }
  if (!result.fault.empty()) {
    out << fmt::format("{:<11} {:<10} FAILED: {}\n", probe.name, size, result.fault);
    return false;
  }
  out << fmt::format("{:<11} {:<10} {:>7.2f} {:>7.2f} {:>6.0f} {:>7.0f} {:>6.1f}  {}\n", probe.name,
                     size, result.mean_ms, result.worst_ms, 1000 / result.mean_ms,
                     result.bitrate_kbps, result.psnr_db, result.stream)
      << std::flush;
  return true;
}

}  // namespace

int run_selftest(std::ostream& out) {
  out << fmt::format("{} frames a row at {} fps nominal, one thread, a panning test picture\n\n",
                     frames, fps)
      << fmt::format("{:<11} {:<10} {:>7} {:>7} {:>6} {:>7} {:>6}  {}\n", "encoder", "size",
                     "ms mean", "ms max", "fps", "kbit/s", "dB", "stream");
  bool any_usable = false;
  bool all_passed = true;
  for (const EncoderProbe& probe : probe_encoders()) {
    if (!probe.usable) {
      out << fmt::format("{:<11} not usable: {}\n", probe.name, probe.reason);
      continue;
    }
    any_usable = true;
    for (const Workload& workload : workloads) {
      all_passed = run_one(probe, workload, out) && all_passed;
    }
  }
  if (!any_usable) out << "\nNo encoder is usable: install a libavcodec with libx264.\n";
  return any_usable && all_passed ? 0 : 1;
}

}  // namespace catgs
