#pragma once

#include <cub/warp/warp_scan.cuh>

namespace catgs::cuda {

template <class T>
struct WarpSums {
  T before;  // of the lanes before this one
  T all;
};

/// Adds up one value per lane; all lanes of the warp take part.
template <class T>
__device__ WarpSums<T> warp_sums(T value) {
  typename cub::WarpScan<T>::TempStorage none;  // the scan of a whole warp needs shuffles alone
  static_assert(sizeof(none) <= 1);
  WarpSums<T> sums;
  cub::WarpScan<T>(none).ExclusiveSum(value, sums.before, sums.all);
  return sums;
}

}  // namespace catgs::cuda
