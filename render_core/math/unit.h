#pragma once

// Every formula of the renderer is one function template over a number type T, in the *-inl.h files
// of this folder. They are compiled
//   - for float and double, host and CUDA device, into namespace catgs::math;
//   - for SIMD lanes (render_core/cpu/lanes-inl.h), once per instruction set, into
//     catgs::HWY_NAMESPACE. Such a translation unit includes hwy/foreach_target.h and
//     hwy/highway.h first, and Highway's toggle guards make each file visible again per target.
//
// T needs + - * /, unary -, comparisons, construction from double and the functions of
// number-inl.h.

#if defined(HWY_HIGHWAY_INCLUDED)
#define CATGS_MATH_NAMESPACE HWY_NAMESPACE
#define CATGS_BEFORE_MATH() HWY_BEFORE_NAMESPACE()
#define CATGS_AFTER_MATH() HWY_AFTER_NAMESPACE()
#else
#define CATGS_MATH_NAMESPACE math
#define CATGS_BEFORE_MATH() static_assert(true, "asks for a semicolon")
#define CATGS_AFTER_MATH() static_assert(true, "asks for a semicolon")
#endif
