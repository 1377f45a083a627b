#include "render_core/metrics/image_quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <stdexcept>

#include "render_core/metrics/summary.h"

namespace catgs {
namespace {

constexpr int block_px = 16;
constexpr int window_px = 11;

std::array<double, window_px> gaussian_window() {
  constexpr double sigma_px = 1.5;
  std::array<double, window_px> weights{};
  double sum = 0.0;
  for (int i = 0; i < window_px; ++i) {
    const double x = (i - window_px / 2) / sigma_px;
    sum += weights[i] = std::exp(-0.5 * x * x);
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

/// Local means of the two signals, their squares and their product.
struct Moments {
  double a = 0.0, b = 0.0, aa = 0.0, bb = 0.0, ab = 0.0;

  void add(double weight, const Moments& other) {
    a += weight * other.a;
    b += weight * other.b;
    aa += weight * other.aa;
    bb += weight * other.bb;
    ab += weight * other.ab;
  }
};

double ssim_of(const Moments& m) {
  constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  const double variance_a = m.aa - m.a * m.a;
  const double variance_b = m.bb - m.b * m.b;
  const double covariance = m.ab - m.a * m.b;
  return (2.0 * m.a * m.b + c1) * (2.0 * covariance + c2) /
         ((m.a * m.a + m.b * m.b + c1) * (variance_a + variance_b + c2));
}

/// Sum of SSIM over all window positions of one channel. The window is separable: rows are
/// filtered once and kept for the eleven windows that meet them.
double ssim_sum(const Image& a, const Image& b, int channel) {
  static const std::array<double, window_px> weights = gaussian_window();
  const int columns = a.size_px.x - window_px + 1;
  std::array<std::vector<Moments>, window_px> rows;  // row y lies in rows[y % window_px]
  double sum = 0.0;
  for (int y = 0; y < a.size_px.y; ++y) {
    std::vector<Moments>& filtered = rows[y % window_px];
    filtered.assign(static_cast<std::size_t>(columns), {});
    for (int x = 0; x < columns; ++x) {
      for (int i = 0; i < window_px; ++i) {
        const double va = a.row(y)[(x + i) * 3 + channel];
        const double vb = b.row(y)[(x + i) * 3 + channel];
        filtered[x].add(weights[i], {va, vb, va * va, vb * vb, va * vb});
      }
    }
    if (y < window_px - 1) continue;
    for (int x = 0; x < columns; ++x) {
      Moments window;
      for (int i = 0; i < window_px; ++i) {
        window.add(weights[i], rows[(y - window_px + 1 + i) % window_px][x]);
      }
      sum += ssim_of(window);
    }
  }
  return sum;
}

double mean_ssim(const Image& a, const Image& b) {
  const glm::ivec2 positions = a.size_px - (window_px - 1);
  if (positions.x < 1 || positions.y < 1) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0.0;
  for (int channel = 0; channel < 3; ++channel) sum += ssim_sum(a, b, channel);
  return sum / (3.0 * positions.x * positions.y);
}

}  // namespace

double psnr_db(double mean_squared_error) {
  return mean_squared_error > 0.0 ? -10.0 * std::log10(mean_squared_error)
                                  : std::numeric_limits<double>::infinity();
}

double ImageQuality::block_0_1_percent_psnr() const {
  return psnr_db(percentile(block_errors, 0.999));
}

ImageQuality compare_images(const Image& a, const Image& b) {
  if (a.size_px != b.size_px || a.rgb.empty()) {
    throw std::invalid_argument("compare_images: needs two pictures of one size");
  }
  ImageQuality quality;
  double total = 0.0;
  for (int top = 0; top < a.size_px.y; top += block_px) {
    for (int left = 0; left < a.size_px.x; left += block_px) {
      const int bottom = std::min(top + block_px, a.size_px.y);
      const int right = std::min(left + block_px, a.size_px.x);
      double sum = 0.0;
      for (int y = top; y < bottom; ++y) {
        for (int i = left * 3; i < right * 3; ++i) {
          const double error = static_cast<double>(a.row(y)[i]) - b.row(y)[i];
          sum += error * error;
          quality.max_error = std::max(quality.max_error, std::abs(error));
        }
      }
      total += sum;
      quality.block_errors.push_back(sum / (3.0 * (bottom - top) * (right - left)));
    }
  }
  std::ranges::sort(quality.block_errors);
  quality.mean_squared_error = total / static_cast<double>(a.rgb.size());
  quality.ssim = mean_ssim(a, b);
  return quality;
}

double pop_excess(const Step& shown, const Step& truth) {
  const std::size_t count = shown.after.rgb.size();
  for (const Image* image : {&shown.before, &truth.before, &truth.after}) {
    if (image->size_px != shown.after.size_px || count == 0) {
      throw std::invalid_argument("pop_excess: needs four pictures of one size");
    }
  }
  std::vector<double> excess(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto change = [i](const Step& step) {
      return std::abs(static_cast<double>(step.after.rgb[i]) - step.before.rgb[i]);
    };
    excess[i] = change(shown) - change(truth);
  }
  const auto rank = static_cast<std::size_t>(std::ceil(0.999 * static_cast<double>(count))) - 1;
  const auto position = excess.begin() + static_cast<std::ptrdiff_t>(rank);
  std::ranges::nth_element(excess, position);
  return *position;
}

}  // namespace catgs
