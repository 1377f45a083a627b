#include "server/encode/jpeg_rate.h"

#include <algorithm>
#include <cmath>

namespace catgs {

namespace {

constexpr double exponent = 0.7;
// Before the first frame: what a rendered scene takes at qscale 1.
constexpr double typical_bytes_per_pixel = 0.25;

}  // namespace

JpegRateControl::JpegRateControl(int bitrate_kbps, int fps, std::size_t pixels)
    : fps_(fps), complexity_(typical_bytes_per_pixel * static_cast<double>(pixels)) {
  set_bitrate(bitrate_kbps);
}

void JpegRateControl::set_bitrate(int bitrate_kbps) { budget_bytes_ = bitrate_kbps * 125.0 / fps_; }

void JpegRateControl::update(int qscale, std::size_t bytes) {
  complexity_ = static_cast<double>(bytes) * std::pow(qscale, exponent);
}

int JpegRateControl::qscale() const {
  const double wanted = std::pow(complexity_ / budget_bytes_, 1 / exponent);
  return static_cast<int>(std::ceil(std::clamp(wanted, finest_qscale, coarsest_qscale)));
}

}  // namespace catgs
