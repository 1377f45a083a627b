#if defined(CATGS_MATH_NUMBER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_NUMBER_INL_H
#undef CATGS_MATH_NUMBER_INL_H
#else
#define CATGS_MATH_NUMBER_INL_H
#endif

#include <cmath>

#include "render_core/base/host_device.h"
#include "render_core/math/unit.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

// The functions that a number type must have, for float and double. Lanes have the same ones.

template <class T>
CATGS_HD_INLINE T select(bool condition, T if_true, T if_false) {
  return condition ? if_true : if_false;
}
CATGS_HD_INLINE bool none(bool condition) { return !condition; }
#if defined(__CUDA_ARCH__)
__device__ __forceinline__ float min(float a, float b) { return fminf(a, b); }  // one instruction
__device__ __forceinline__ float max(float a, float b) { return fmaxf(a, b); }
#else
CATGS_HD_INLINE float min(float a, float b) { return a < b ? a : b; }
CATGS_HD_INLINE float max(float a, float b) { return a > b ? a : b; }
#endif
CATGS_HD_INLINE double min(double a, double b) { return a < b ? a : b; }
CATGS_HD_INLINE double max(double a, double b) { return a > b ? a : b; }
CATGS_HD_INLINE float sqrt(float a) { return std::sqrt(a); }
CATGS_HD_INLINE double sqrt(double a) { return std::sqrt(a); }
CATGS_HD_INLINE float abs(float a) { return std::fabs(a); }
CATGS_HD_INLINE double abs(double a) { return std::fabs(a); }
CATGS_HD_INLINE float ceil(float a) { return std::ceil(a); }
CATGS_HD_INLINE double ceil(double a) { return std::ceil(a); }

/// a * b + c, with one rounding where the machine has it for free.
CATGS_HD_INLINE float mul_add(float a, float b, float c) { return a * b + c; }
CATGS_HD_INLINE double mul_add(double a, double b, double c) { return a * b + c; }
/// c - a * b, likewise.
CATGS_HD_INLINE float neg_mul_add(float a, float b, float c) { return c - a * b; }
CATGS_HD_INLINE double neg_mul_add(double a, double b, double c) { return c - a * b; }

/// 2^x for the exponent of a visible contribution, x in [-8, 0].
CATGS_HD_INLINE float exp2_of_alpha(float x) { return exp2f(x); }
CATGS_HD_INLINE double exp2_of_alpha(double x) { return exp2(x); }

/// log2(x) for a transmittance or an opacity, x in (0, 1].
CATGS_HD_INLINE float log2_of_share(float x) { return log2f(x); }
CATGS_HD_INLINE double log2_of_share(double x) { return log2(x); }

template <class T>
CATGS_HD_INLINE T clamp(T value, T low, T high) {
  return min(max(value, low), high);
}

template <class T>
struct Vec2 {
  T x, y;
};

template <class T>
struct Vec3 {
  T x, y, z;
};

template <class T, class S>
CATGS_HD_INLINE Vec2<T> convert(const Vec2<S>& v) {
  return {T(v.x), T(v.y)};
}

template <class T, class S>
CATGS_HD_INLINE Vec3<T> convert(const Vec3<S>& v) {
  return {T(v.x), T(v.y), T(v.z)};
}

template <class T>
CATGS_HD_INLINE Vec3<T> operator-(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}

template <class T>
CATGS_HD_INLINE Vec3<T> operator*(const Vec3<T>& a, T s) {
  return {a.x * s, a.y * s, a.z * s};
}

template <class T>
CATGS_HD_INLINE T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return mul_add(a.x, b.x, mul_add(a.y, b.y, a.z * b.z));
}

template <class T>
CATGS_HD_INLINE Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
