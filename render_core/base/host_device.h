#pragma once

// Lets one function compile for the host and, under nvcc, for the device.
#if defined(__CUDACC__)
#define CATGS_HD __host__ __device__
#define CATGS_HD_INLINE __host__ __device__ __forceinline__
#else
#define CATGS_HD
// The formulas pass small structs of SIMD registers; a call would spill every one of them.
#define CATGS_HD_INLINE inline __attribute__((always_inline))
#endif
