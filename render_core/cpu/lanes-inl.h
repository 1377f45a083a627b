#if defined(CATGS_CPU_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_LANES_INL_H
#undef CATGS_CPU_LANES_INL_H
#else
#define CATGS_CPU_LANES_INL_H
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render_core/base/host_device.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// One bool per lane.
template <class D>
struct LaneMask {
  hn::Mask<D> mask;
};

/// A SIMD register that behaves like a number, so that the formulas of render_core/math apply to
/// all its lanes.
template <class D>
struct Lanes {
  using Scalar = hn::TFromD<D>;
  static constexpr std::size_t count = hn::MaxLanes(D());

  hn::Vec<D> v;

  Lanes() = default;
  CATGS_HD_INLINE explicit Lanes(double value) : v(hn::Set(D(), static_cast<Scalar>(value))) {}
  CATGS_HD_INLINE explicit Lanes(float value) : v(hn::Set(D(), static_cast<Scalar>(value))) {}
  CATGS_HD_INLINE explicit Lanes(hn::Vec<D> vector) : v(vector) {}

  static CATGS_HD_INLINE Lanes load(const Scalar* aligned) { return Lanes(hn::Load(D(), aligned)); }
  static CATGS_HD_INLINE Lanes iota(float first) {
    return Lanes(hn::Iota(D(), static_cast<Scalar>(first)));
  }
  CATGS_HD_INLINE void store(Scalar* aligned) const { hn::Store(v, D(), aligned); }
};

#define CATGS_LANES_OPERATOR(op, function)                                     \
  template <class D>                                                           \
  CATGS_HD_INLINE Lanes<D> operator op(const Lanes<D>& a, const Lanes<D>& b) { \
    return Lanes<D>(hn::function(a.v, b.v));                                   \
  }
CATGS_LANES_OPERATOR(+, Add)
CATGS_LANES_OPERATOR(-, Sub)
CATGS_LANES_OPERATOR(*, Mul)
CATGS_LANES_OPERATOR(/, Div)
#undef CATGS_LANES_OPERATOR

#define CATGS_LANES_COMPARISON(op, function)                                      \
  template <class D>                                                              \
  CATGS_HD_INLINE LaneMask<D> operator op(const Lanes<D>& a, const Lanes<D>& b) { \
    return {hn::function(a.v, b.v)};                                              \
  }
CATGS_LANES_COMPARISON(<, Lt)
CATGS_LANES_COMPARISON(<=, Le)
CATGS_LANES_COMPARISON(>, Gt)
CATGS_LANES_COMPARISON(>=, Ge)
#undef CATGS_LANES_COMPARISON

template <class D>
CATGS_HD_INLINE Lanes<D> operator-(const Lanes<D>& a) {
  return Lanes<D>(hn::Neg(a.v));
}

template <class D>
CATGS_HD_INLINE LaneMask<D> operator&(const LaneMask<D>& a, const LaneMask<D>& b) {
  return {hn::And(a.mask, b.mask)};
}

template <class D>
CATGS_HD_INLINE LaneMask<D> operator|(const LaneMask<D>& a, const LaneMask<D>& b) {
  return {hn::Or(a.mask, b.mask)};
}

template <class D>
CATGS_HD_INLINE bool none(const LaneMask<D>& m) {
  return hn::AllFalse(D(), m.mask);
}

/// Bit i is lane i.
template <class D>
CATGS_HD_INLINE std::uint32_t bits(const LaneMask<D>& m) {
  std::uint8_t bytes[8] = {};  // StoreMaskBits may write 8 bytes
  hn::StoreMaskBits(D(), m.mask, bytes);
  std::uint32_t result = 0;
  __builtin_memcpy(&result, bytes, sizeof(result));
  return result & ((1u << Lanes<D>::count) - 1u);
}

/// The inverse of bits().
template <class D>
CATGS_HD_INLINE LaneMask<D> mask_of_bits(std::uint32_t bits) {
  std::uint8_t bytes[8] = {};
  __builtin_memcpy(bytes, &bits, sizeof(bits));
  return {hn::LoadMaskBits(D(), bytes)};
}

template <class D>
CATGS_HD_INLINE Lanes<D> select(const LaneMask<D>& m, const Lanes<D>& if_true,
                                const Lanes<D>& if_false) {
  return Lanes<D>(hn::IfThenElse(m.mask, if_true.v, if_false.v));
}

template <class D>
CATGS_HD_INLINE Lanes<D> min(const Lanes<D>& a, const Lanes<D>& b) {
  return Lanes<D>(hn::Min(a.v, b.v));
}

template <class D>
CATGS_HD_INLINE Lanes<D> max(const Lanes<D>& a, const Lanes<D>& b) {
  return Lanes<D>(hn::Max(a.v, b.v));
}

template <class D>
CATGS_HD_INLINE Lanes<D> sqrt(const Lanes<D>& a) {
  return Lanes<D>(hn::Sqrt(a.v));
}

template <class D>
CATGS_HD_INLINE Lanes<D> abs(const Lanes<D>& a) {
  return Lanes<D>(hn::Abs(a.v));
}

template <class D>
CATGS_HD_INLINE Lanes<D> floor(const Lanes<D>& a) {
  return Lanes<D>(hn::Floor(a.v));
}

template <class D>
CATGS_HD_INLINE Lanes<D> ceil(const Lanes<D>& a) {
  return Lanes<D>(hn::Ceil(a.v));
}

template <class D>
CATGS_HD_INLINE Lanes<D> mul_add(const Lanes<D>& a, const Lanes<D>& b, const Lanes<D>& c) {
  return Lanes<D>(hn::MulAdd(a.v, b.v, c.v));
}

template <class D>
CATGS_HD_INLINE Lanes<D> neg_mul_add(const Lanes<D>& a, const Lanes<D>& b, const Lanes<D>& c) {
  return Lanes<D>(hn::NegMulAdd(a.v, b.v, c.v));
}

/// 2^x for x in [-8, 0] with a relative error below 2.1e-5 (an alpha is off by less than a
/// hundredth of an 8-bit step): the minimax polynomial of 2^(x/8), raised to the 8th power. Cheaper
/// than splitting off the integer part, which is unnecessary on the short range.
template <class D>
CATGS_HD_INLINE Lanes<D> exp2_of_alpha(const Lanes<D>& x) {
  using L = Lanes<D>;
  const L eighth_root =
      mul_add(mul_add(mul_add(mul_add(L(1.6521201064107867e-6), x, L(1.0366028541589878e-4)), x,
                              L(3.7397042672933905e-3)),
                      x, L(8.662877510921217e-2)),
              x, L(0.9999974066293347));
  const L quarter = eighth_root * eighth_root;
  const L half = quarter * quarter;
  return half * half;
}

template <class D>
CATGS_HD_INLINE Lanes<D> log2_of_share(const Lanes<D>& x) {
  return Lanes<D>(hn::Log2(D(), x.v));
}

using Floats = Lanes<hn::ScalableTag<float>>;
using FloatMask = LaneMask<hn::ScalableTag<float>>;
using Doubles = Lanes<hn::ScalableTag<double>>;

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif
