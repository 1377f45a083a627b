#pragma once

#include <cstdint>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/cuda/device_buffer.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/packed_gaussian.h"

namespace catgs::cuda {

/// A scene as kernels see it. Pointers are device memory. Gaussians are in the order of their
/// clusters: Gaussian i is number i % cluster_size of cluster i / cluster_size.
struct SceneArrays {
  std::uint32_t count = 0;
  std::uint32_t cluster_count = 0;
  int sh_degree = 0;
  const std::byte* blocks = nullptr;   // [cluster_count][packed_block_bytes(sh_degree)]
  const PackedUnits* units = nullptr;  // [cluster_count]
  const Cluster* clusters = nullptr;   // [cluster_count]
  // [cluster_count], the part of each cluster that a frame draws, see math/fade-inl.h; null: all.
  const float* share = nullptr;
};

/// The source of the copies on all devices.
struct SceneSource {
  const GaussianCloud& cloud;
  std::vector<std::uint32_t> order;  // morton_order()
  ThreadPool& pool;
};

/// Device memory for clusters.
class ClusterMemory {
 public:
  /// Allocates on the current device. Throws CudaError.
  ClusterMemory(std::size_t clusters, int sh_degree);

  [[nodiscard]] std::size_t bytes() const {
    return blocks.bytes() + units.bytes() + clusters.bytes();
  }
  /// The first `gaussians` of the memory.
  [[nodiscard]] SceneArrays arrays(std::size_t gaussians) const;

  DeviceBuffer<std::byte> blocks;
  DeviceBuffer<PackedUnits> units;
  DeviceBuffer<Cluster> clusters;

 private:
  int sh_degree_;
};

/// Copies a whole scene to the current device. Throws CudaError.
ClusterMemory upload(const SceneSource& source);

}  // namespace catgs::cuda
