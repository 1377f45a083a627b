#include "render_core/metrics/image_quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <stdexcept>

#include "render_core/math/colour-inl.h"
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

/// One channel of a picture.
struct Channel {
  const float* first;
  int step;  // from a pixel to the next
  glm::ivec2 size_px;

  [[nodiscard]] double at(int x, int y) const {
    return first[(static_cast<std::ptrdiff_t>(y) * size_px.x + x) * step];
  }
};

/// Mean of SSIM over all window positions. The window is separable: rows are filtered once and kept
/// for the eleven windows that meet them.
double mean_ssim(const Channel& a, const Channel& b) {
  static const std::array<double, window_px> weights = gaussian_window();
  const int columns = a.size_px.x - window_px + 1;
  if (columns < 1 || a.size_px.y < window_px) return std::numeric_limits<double>::quiet_NaN();
  std::array<std::vector<Moments>, window_px> rows;  // row y lies in rows[y % window_px]
  double sum = 0.0;
  for (int y = 0; y < a.size_px.y; ++y) {
    std::vector<Moments>& filtered = rows[y % window_px];
    filtered.assign(static_cast<std::size_t>(columns), {});
    for (int x = 0; x < columns; ++x) {
      for (int i = 0; i < window_px; ++i) {
        const double va = a.at(x + i, y);
        const double vb = b.at(x + i, y);
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
  return sum / (static_cast<double>(columns) * (a.size_px.y - window_px + 1));
}

/// BT.709 luma of each pixel.
std::vector<float> luma_of(const Image& image) {
  using math::luma_blue, math::luma_green, math::luma_red;
  std::vector<float> luma(image.pixels());
  for (std::size_t i = 0; i < luma.size(); ++i) {
    luma[i] = static_cast<float>(luma_red * image.rgb[3 * i] + luma_green * image.rgb[3 * i + 1] +
                                 luma_blue * image.rgb[3 * i + 2]);
  }
  return luma;
}

void check_sizes(const Image& a, const Image& b) {
  if (a.size_px != b.size_px || a.rgb.empty())
    throw std::invalid_argument("compare_images: needs two pictures of one size");
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
  check_sizes(a, b);
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
  quality.ssim = 0.0;
  for (int c = 0; c < 3; ++c) {
    quality.ssim +=
        mean_ssim({a.rgb.data() + c, 3, a.size_px}, {b.rgb.data() + c, 3, b.size_px}) / 3.0;
  }
  quality.ssim_luma = luma_ssim(a, b);
  return quality;
}

double luma_ssim(const Image& a, const Image& b) {
  check_sizes(a, b);
  const std::vector<float> luma_a = luma_of(a), luma_b = luma_of(b);
  return mean_ssim({luma_a.data(), 1, a.size_px}, {luma_b.data(), 1, b.size_px});
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
