#pragma once

// Lets one function compile for the host and, under nvcc, for the device.
#if defined(__CUDACC__)
#define CATGS_HD __host__ __device__
#else
#define CATGS_HD
#endif
