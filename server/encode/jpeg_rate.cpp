#include "server/encode/jpeg_rate.h"

#include <algorithm>
#include <cmath>

namespace catgs {

namespace {

constexpr double exponent = 0.7;
// The start value: the bytes of a rendered scene at qscale 1.
constexpr double typical_bytes_per_pixel = 0.25;

}  // namespace

JpegRateControl::JpegRateControl(std::size_t pixels)
    : complexity_(typical_bytes_per_pixel * static_cast<double>(pixels)) {}

void JpegRateControl::set_budget(int bitrate_kbps, int fps) {
  budget_bytes_ = bitrate_kbps * 125.0 / fps;
}

int JpegRateControl::qscale() const {
  const double wanted = std::ceil(std::pow(complexity_ / budget_bytes_, 1 / exponent));
  return static_cast<int>(std::clamp<double>(wanted, finest_qscale, coarsest_qscale));
}

void JpegRateControl::update(int qscale, std::size_t bytes) {
  complexity_ = static_cast<double>(bytes) * std::pow(qscale, exponent);
}

}  // namespace catgs
