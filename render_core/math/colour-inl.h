#if defined(CATGS_MATH_COLOUR_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_COLOUR_INL_H
#undef CATGS_MATH_COLOUR_INL_H
#else
#define CATGS_MATH_COLOUR_INL_H
#endif

#include "render_core/math/number-inl.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

// ITU-R BT.709-6: luma weights, and 8-bit limited range (luma 16…235, chroma 16…240 around 128).
inline constexpr double luma_red = 0.2126, luma_green = 0.7152, luma_blue = 0.0722;

/// Luma code of a display-referred colour in [0, 1], not yet rounded.
template <class T>
CATGS_HD_INLINE T luma_code(const Vec3<T>& rgb) {
  const T luma = mul_add(T(luma_red), rgb.x, mul_add(T(luma_green), rgb.y, T(luma_blue) * rgb.z));
  return mul_add(T(219.0), luma, T(16.0));
}

/// Chroma codes (Cb, Cr), not yet rounded.
template <class T>
CATGS_HD_INLINE Vec2<T> chroma_codes(const Vec3<T>& rgb) {
  const T luma = mul_add(T(luma_red), rgb.x, mul_add(T(luma_green), rgb.y, T(luma_blue) * rgb.z));
  return {mul_add(T(112.0 / (1.0 - luma_blue)), rgb.z - luma, T(128.0)),
          mul_add(T(112.0 / (1.0 - luma_red)), rgb.x - luma, T(128.0))};
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
