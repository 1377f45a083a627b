#include "render_core/metrics/image_quality.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

namespace catgs {
namespace {

Image noise(int width, int height, unsigned seed) {
  std::mt19937 rng(seed);
  Image image{{width, height}, {}};
  for (int i = 0; i < width * height * 3; ++i) {
    image.rgb.push_back(static_cast<float>(rng() % 256) / 255.0f);
  }
  return image;
}

TEST(PopExcess, IsTheRareLargeChangeBeyondTheTrueOne) {
  const Image truth_before = noise(100, 50, 1);
  Image truth_after = truth_before;
  for (float& value : truth_after.rgb) value += 0.1f;
  const Step truth{truth_before, truth_after};
  EXPECT_NEAR(pop_excess(truth, truth), 0.0, 1e-9);
  Image shown = truth_after;
  // 15000 channels: 14 faulty ones are fewer than 0.1 %, 16 are more.
  for (std::size_t i = 0; i < 14; ++i) shown.rgb[i * 997] += 0.05f;
  EXPECT_NEAR(pop_excess({truth_before, shown}, truth), 0.0, 1e-6);
  for (std::size_t i = 14; i < 16; ++i) shown.rgb[i * 997] += 0.05f;
  EXPECT_NEAR(pop_excess({truth_before, shown}, truth), 0.05, 1e-6);
  EXPECT_NEAR(pop_excess({truth_before, truth_before}, truth), -0.1, 1e-6);  // a missed change
  EXPECT_THROW(pop_excess({truth_before, noise(50, 100, 1)}, truth), std::invalid_argument);
}

/// SSIM straight from its definition: every window summed on its own.
double slow_ssim(const Image& a, const Image& b) {
  double total = 0.0;
  int windows = 0;
  for (int c = 0; c < 3; ++c) {
    for (int top = 0; top + 11 <= a.size_px.y; ++top) {
      for (int left = 0; left + 11 <= a.size_px.x; ++left) {
        double weight_sum = 0.0, mean_a = 0.0, mean_b = 0.0;
        const auto for_window = [&](auto&& visit) {
          for (int y = 0; y < 11; ++y) {
            for (int x = 0; x < 11; ++x) {
              const double r2 = (x - 5) * (x - 5) + (y - 5) * (y - 5);
              visit(std::exp(-r2 / (2.0 * 1.5 * 1.5)), double{a.row(top + y)[(left + x) * 3 + c]},
                    double{b.row(top + y)[(left + x) * 3 + c]});
            }
          }
        };
        for_window([&](double w, double va, double vb) {
          weight_sum += w;
          mean_a += w * va;
          mean_b += w * vb;
        });
        mean_a /= weight_sum;
        mean_b /= weight_sum;
        double var_a = 0.0, var_b = 0.0, cov = 0.0;
        for_window([&](double w, double va, double vb) {
          var_a += w / weight_sum * (va - mean_a) * (va - mean_a);
          var_b += w / weight_sum * (vb - mean_b) * (vb - mean_b);
          cov += w / weight_sum * (va - mean_a) * (vb - mean_b);
        });
        total += (2 * mean_a * mean_b + 1e-4) * (2 * cov + 9e-4) /
                 ((mean_a * mean_a + mean_b * mean_b + 1e-4) * (var_a + var_b + 9e-4));
        ++windows;
      }
    }
  }
  return total / windows;
}

TEST(ImageQuality, IdenticalPicturesArePerfect) {
  const Image image = noise(40, 30, 1);
  const ImageQuality quality = compare_images(image, image);
  EXPECT_TRUE(std::isinf(quality.psnr()));
  EXPECT_TRUE(std::isinf(quality.worst_block_psnr()));
  EXPECT_DOUBLE_EQ(quality.ssim, 1.0);
  EXPECT_EQ(quality.max_error, 0.0);
}

TEST(ImageQuality, PsnrOfAConstantOffset) {
  Image a{{20, 20}, std::vector<float>(1200, 0.5f)};
  Image b{{20, 20}, std::vector<float>(1200, 0.6f)};
  EXPECT_NEAR(compare_images(a, b).psnr(), 20.0, 1e-4);
  EXPECT_NEAR(compare_images(a, b).max_error, 0.1, 1e-6);
}

TEST(ImageQuality, SsimFollowsItsDefinition) {
  const Image a = noise(23, 17, 2);
  Image b = a;
  const Image other = noise(23, 17, 3);
  for (std::size_t i = 0; i < b.rgb.size(); ++i) b.rgb[i] = 0.7f * b.rgb[i] + 0.3f * other.rgb[i];
  const double expected = slow_ssim(a, b);
  EXPECT_GT(expected, 0.5);
  EXPECT_LT(expected, 0.99);
  EXPECT_NEAR(compare_images(a, b).ssim, expected, 1e-9);
  EXPECT_NEAR(compare_images(b, a).ssim, expected, 1e-9);
}

TEST(ImageQuality, SsimOfLumaIsThatOfGreyPictures) {
  const auto grey = [](Image image) {
    for (std::size_t i = 0; i < image.rgb.size(); i += 3) {
      float* rgb = &image.rgb[i];
      rgb[0] = rgb[1] = rgb[2] = 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
    }
    return image;
  };
  const Image a = noise(23, 17, 2), b = noise(23, 17, 3);
  EXPECT_NEAR(luma_ssim(a, b), compare_images(grey(a), grey(b)).ssim, 1e-5);
  EXPECT_EQ(compare_images(a, b).ssim_luma, luma_ssim(a, b));
}

TEST(ImageQuality, FindsOneFaultyBlockAndCutsTheEdges) {
  const Image a{{1000, 1000}, std::vector<float>(3'000'000, 0.5f)};  // 63 x 63 blocks
  Image b = a;
  for (int y = 992; y < 1000; ++y) {
    for (int x = 992; x < 1000; ++x) b.rgb[(y * 1000 + x) * 3 + 1] = 0.0f;
  }
  const ImageQuality quality = compare_images(a, b);
  EXPECT_EQ(quality.block_errors.size(), 63u * 63u);
  EXPECT_GT(quality.psnr(), 50.0);
  EXPECT_NEAR(quality.worst_block_psnr(), -10.0 * std::log10(0.25 / 3.0), 1e-6);
  EXPECT_TRUE(std::isinf(quality.block_0_1_percent_psnr()));
  EXPECT_NEAR(quality.max_error, 0.5, 1e-7);
}

TEST(ImageQuality, SsimNeedsAWindow) {
  EXPECT_TRUE(std::isnan(compare_images(noise(10, 40, 1), noise(10, 40, 2)).ssim));
  EXPECT_FALSE(std::isnan(compare_images(noise(11, 11, 1), noise(11, 11, 2)).ssim));
}

TEST(ImageQuality, RefusesDifferentSizes) {
  EXPECT_THROW(compare_images(noise(4, 5, 1), noise(5, 4, 1)), std::invalid_argument);
  EXPECT_THROW(compare_images({}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace catgs
