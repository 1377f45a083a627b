#if defined(CATGS_MATH_FADE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_MATH_FADE_INL_H
#undef CATGS_MATH_FADE_INL_H
#else
#define CATGS_MATH_FADE_INL_H
#endif

#include "render_core/math/constants.h"
#include "render_core/math/number-inl.h"

CATGS_BEFORE_MATH();
namespace catgs {
namespace CATGS_MATH_NAMESPACE {

/// The opacity of a Gaussian of which only a share is drawn, in (0, 1): 1 - (1 - opacity)^share.
/// Transmittances multiply, so Gaussians that stand for the same surface with shares that sum to 1
/// hide as much as one of them with all. Opacities are base-2 logarithms. Those under alpha_min
/// stay as they are.
template <class T>
CATGS_HD_INLINE T faded_log2_opacity(T log2_opacity, T share) {
  const T visible = max(log2_opacity, T(log2_alpha_min));
  const T transmittance = T(1.0) - min(exp2_of_alpha(visible), T(alpha_max));
  const T faded = log2_of_share(T(1.0) - exp2_of_alpha(share * log2_of_share(transmittance)));
  return select(log2_opacity > T(log2_alpha_min), faded, log2_opacity);
}

}  // namespace CATGS_MATH_NAMESPACE
}  // namespace catgs
CATGS_AFTER_MATH();

#endif
