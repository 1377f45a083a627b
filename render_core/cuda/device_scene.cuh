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
///
/// The blocks of clusters lie in chunks of 2^chunk_shift clusters. Of a whole scene there is one
/// chunk. Of a scene in pages a chunk is a slot, whose size does not depend on the scene.
struct SceneArrays {
  static constexpr std::uint32_t one_chunk = 31;  // a chunk_shift

  std::uint32_t count = 0;
  std::uint32_t cluster_count = 0;
  std::uint32_t frame_clusters = 0;  // the most that a frame may look at
  int sh_degree = 0;
  bool antialiased = false;       // see SplatModel
  std::uint32_t block_bytes = 0;  // packed_block_bytes(sh_degree)
  std::uint32_t chunk_shift = one_chunk, chunk_bytes = 0;
  const std::byte* blocks = nullptr;
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
struct ClusterMemory {
  /// Allocates on the current device. Throws CudaError.
  ClusterMemory(std::size_t cluster_count, std::size_t bytes_of_blocks);

  [[nodiscard]] std::size_t bytes() const {
    return blocks.bytes() + units.bytes() + clusters.bytes();
  }
  /// As one chunk.
  [[nodiscard]] SceneArrays arrays(std::size_t gaussians, int sh_degree) const;

  DeviceBuffer<std::byte> blocks;
  DeviceBuffer<PackedUnits> units;
  DeviceBuffer<Cluster> clusters;
};

/// Copies a whole scene to the current device. Throws CudaError.
ClusterMemory upload(const SceneSource& source);

}  // namespace catgs::cuda
