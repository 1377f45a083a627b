#pragma once

#include <cstddef>
#include <vector>

#include "render_core/image/image.h"

namespace catgs {

/// PSNR in dB of a mean squared error of values in [0, 1]; infinite for 0.
double psnr_db(double mean_squared_error);

/// The difference of two pictures. One of them is the truth, but the numbers are symmetric.
struct ImageQuality {
  double mean_squared_error = 0.0;  // over pixels and channels
  double max_error = 0.0;           // largest absolute difference of a channel
  double ssim = 1.0;                // NaN for pictures smaller than the window
  double ssim_luma = 1.0;
  // Mean squared errors of the 16x16 blocks from the upper left corner (cut at the right and lower
  // edges), in increasing order. One faulty tile hides in a mean of 52 dB, not here.
  std::vector<double> block_errors;

  [[nodiscard]] double psnr() const { return psnr_db(mean_squared_error); }
  [[nodiscard]] double worst_block_psnr() const { return psnr_db(block_errors.back()); }
  /// PSNR of the block at the 0.1 % quantile: 0.1 % of the blocks are worse.
  [[nodiscard]] double block_0_1_percent_psnr() const;
};

/// Both pictures must have the same, positive size (std::invalid_argument). SSIM is that of Wang et
/// al. (2004): 11x11 Gaussian window of sigma 1.5 px, K1 = 0.01, K2 = 0.03, on each of R, G and B,
/// averaged over the channels and the positions where the whole window fits.
ImageQuality compare_images(const Image& a, const Image& b);

/// The same SSIM of BT.709 luma alone. Both pictures must have the same size
/// (std::invalid_argument).
double luma_ssim(const Image& a, const Image& b);

/// Two consecutive pictures.
struct Step {
  const Image& before;
  const Image& after;
};

/// How much more the shown pictures change in a step than the true ones: 99.9 % of all channels
/// have a |shown change| - |true change| of at most this. All pictures must have one size
/// (std::invalid_argument).
double pop_excess(const Step& shown, const Step& truth);

}  // namespace catgs
