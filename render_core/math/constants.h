#pragma once

// The numbers that define what a frame must look like (Kerbl et al. 2023 and its reference
// implementation), each with its reason. Doubles: every core rounds them to its own precision.

namespace catgs {

/// Contributions below one step of an 8-bit image are skipped. This also bounds every splat.
inline constexpr double alpha_min = 1.0 / 255.0;
inline constexpr double log2_alpha_min = -7.994353436858858;  // log2(1/255)

/// No single splat is fully opaque, so that transmittance stays positive and training has a
/// gradient behind every splat.
inline constexpr double alpha_max = 0.99;

/// A pixel is finished before its transmittance would fall below this.
inline constexpr double transmittance_min = 1e-4;

/// Pipeline::catgs: a pixel is finished at this transmittance, and its colour is scaled to fill the
/// rest. Measured on one H100 against exact, hon_sui_sen head2 and fungi_room head1: 1/512 gives 75
/// and 74 dB, 1/255 gives 69 and 67, 1/128 gives 62 and 61, 1/100 gives 61 and 58.
inline constexpr double least_shown = 1.0 / 128.0;

/// Added to both variances of a projected Gaussian, in px^2: keeps a splat about a pixel wide, so
/// that it cannot slip between pixel centres.
inline constexpr double low_pass_px2 = 0.3;

/// The projection is linearised at the centre, clamped to this multiple of the half field of view:
/// farther out the linearisation is meaningless and footprints explode.
inline constexpr double fov_clamp = 1.3;

/// sqrt(log2(e) / 2): exp(-q^2 / 2) = exp2(-(exponent_scale q)^2).
inline constexpr double exponent_scale = 0.8493218002880191;

/// Edges of boxes and tile intervals are moved outwards by this, so that rounding in float can
/// never leave out a tile. 1/100 px adds fewer than 0.2 % to the lists.
inline constexpr double listing_slack_px = 0.01;

/// A cached colour is reused until the direction from the camera has turned by this much: a step of
/// 1 cm at 2.5 m. The reuse then costs less quality than 8-bit harmonics do.
inline constexpr double colour_reuse_rad = 0.004;

/// A step of the camera that moves surfaces farther than this against each other, in px, hides
/// nothing.
inline constexpr int most_occlusion_px = 32;

/// Limits are moved back by this share of their depth: a surface's depth varies within a part.
inline constexpr double occlusion_margin = 0.02;

/// The constant spherical-harmonics basis function, 1 / (2 sqrt(pi)).
inline constexpr double sh_basis_0 = 0.28209479177387814;

/// Side of the square tiles that pixels are binned into.
inline constexpr int tile_size_px = 16;

}  // namespace catgs
