#if defined(CATGS_MATH_BLEND_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_BLEND_INL_H
#undef CATGS_MATH_BLEND_INL_H
#else
#define CATGS_MATH_BLEND_INL_H
#endif

#include "render_core/math/constants.h"
#include "render_core/math/number-inl.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

/// The state of a pixel while Gaussians are blended into it, front to back.
template <class T>
struct PixelState {
  Vec3<T> colour;
  T transmittance;  // negative: the pixel is finished and its transmittance is the absolute value
};

template <class T>
CATGS_HD_INLINE PixelState<T> empty_pixel() {
  return {{T(0.0), T(0.0), T(0.0)}, T(1.0)};
}

/// Whether a contribution of alpha = 2^exponent is at least alpha_min.
template <class T>
CATGS_HD_INLINE auto contributes(T exponent) {
  return exponent >= T(log2_alpha_min);
}

/// min(alpha_max, 2^exponent), or 0 where that does not contribute.
template <class T>
CATGS_HD_INLINE T alpha_of(T exponent) {
  return select(contributes(exponent), min(T(alpha_max), exp2_of_alpha(exponent)), T(0.0));
}

/// Blends one Gaussian with alpha_of(exponent) over what lies behind, unless the pixel is finished.
/// A pixel that the Gaussian would take below transmittance_min is finished without it. Returns
/// which pixels are not finished.
template <class T>
CATGS_HD_INLINE auto blend(PixelState<T>& pixel, T exponent, const Vec3<T>& colour) {
  const T alpha = alpha_of(exponent);
  const T weight = alpha * pixel.transmittance;
  const T behind = pixel.transmittance - weight;
  // Negative, hence false, for pixels finished before; true for live pixels that stay live.
  const auto live = behind >= T(transmittance_min);
  const T used = select(live, weight, T(0.0));
  pixel.colour.x = mul_add(used, colour.x, pixel.colour.x);
  pixel.colour.y = mul_add(used, colour.y, pixel.colour.y);
  pixel.colour.z = mul_add(used, colour.z, pixel.colour.z);
  pixel.transmittance = select(live, behind, -abs(pixel.transmittance));
  return live;
}

/// A pixel for a run of Gaussians in registers. Its transmittance continues to fall behind the
/// Gaussian that finishes it, so the next Gaussian waits for one multiply-add only.
template <class T>
struct RunningPixel {
  Vec3<T> colour;
  T running;        // below transmittance_min: the pixel is finished
  T transmittance;  // of the pixel, not negative
};

template <class T>
CATGS_HD_INLINE RunningPixel<T> begin_run(const PixelState<T>& pixel) {
  return {pixel.colour, pixel.transmittance, abs(pixel.transmittance)};
}

template <class T>
CATGS_HD_INLINE PixelState<T> end_run(const RunningPixel<T>& pixel) {
  return {pixel.colour,
          select(pixel.running >= T(transmittance_min), pixel.transmittance, -pixel.transmittance)};
}

/// As for a PixelState.
template <class T>
CATGS_HD_INLINE auto blend(RunningPixel<T>& pixel, T exponent, const Vec3<T>& colour) {
  const T alpha = alpha_of(exponent);
  const T weight = alpha * pixel.running;
  pixel.running = neg_mul_add(alpha, pixel.running, pixel.running);
  const auto live = pixel.running >= T(transmittance_min);
  const T used = select(live, weight, T(0.0));
  pixel.colour.x = mul_add(used, colour.x, pixel.colour.x);
  pixel.colour.y = mul_add(used, colour.y, pixel.colour.y);
  pixel.colour.z = mul_add(used, colour.z, pixel.colour.z);
  pixel.transmittance = select(live, pixel.running, pixel.transmittance);
  return live;
}

/// Blends one Gaussian over what lies behind, for pixels that stop together: those below
/// least_shown continue until all are. Returns which pixels are not below it.
template <class T>
CATGS_HD_INLINE auto blend_on(PixelState<T>& pixel, T exponent, const Vec3<T>& colour) {
  const T weight = alpha_of(exponent) * pixel.transmittance;
  pixel.colour.x = mul_add(weight, colour.x, pixel.colour.x);
  pixel.colour.y = mul_add(weight, colour.y, pixel.colour.y);
  pixel.colour.z = mul_add(weight, colour.z, pixel.colour.z);
  pixel.transmittance = pixel.transmittance - weight;
  return pixel.transmittance >= T(least_shown);
}

/// A pixel whose transmittance is below `least` shows what lies behind it in its own colour.
template <class T>
CATGS_HD_INLINE PixelState<T> filled(const PixelState<T>& pixel, T least) {
  const T rest = abs(pixel.transmittance);
  const auto fills = rest < least;
  const T scale = select(fills, T(1.0) / (T(1.0) - rest), T(1.0));
  return {pixel.colour * scale, select(fills, T(0.0), pixel.transmittance)};
}

/// The pixel over its background, clamped to what a display can show.
template <class T>
CATGS_HD_INLINE Vec3<T> resolve(const PixelState<T>& pixel, const Vec3<T>& background) {
  const T rest = abs(pixel.transmittance);
  const T zero = T(0.0), one = T(1.0);
  return {clamp(mul_add(rest, background.x, pixel.colour.x), zero, one),
          clamp(mul_add(rest, background.y, pixel.colour.y), zero, one),
          clamp(mul_add(rest, background.z, pixel.colour.z), zero, one)};
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
