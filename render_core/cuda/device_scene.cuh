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
};

/// The source of the copies on all devices.
struct SceneSource {
  const GaussianCloud& cloud;
  std::vector<std::uint32_t> order;  // morton_order()
  ThreadPool& pool;
};

/// One scene on one device, shared by all Views.
class DeviceScene {
 public:
  /// Allocates on the current device. Throws CudaError.
  explicit DeviceScene(const SceneSource& source);

  [[nodiscard]] const SceneArrays& arrays() const { return arrays_; }
  [[nodiscard]] std::size_t bytes() const {
    return blocks_.bytes() + units_.bytes() + clusters_.bytes();
  }

 private:
  DeviceBuffer<std::byte> blocks_;
  DeviceBuffer<PackedUnits> units_;
  DeviceBuffer<Cluster> clusters_;
  SceneArrays arrays_;
};

}  // namespace catgs::cuda
