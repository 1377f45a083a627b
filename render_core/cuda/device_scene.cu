#include <algorithm>
#include <cassert>
#include <span>
#include <vector>

#include "render_core/cuda/device_scene.cuh"

namespace catgs::cuda {
namespace {

// Uploads in pieces of some megabytes, so that set-up needs little memory beside the cloud.
constexpr std::size_t clusters_per_upload = 1024;

template <class T>
void copy(T* target, const std::vector<T>& source, std::size_t count) {
  check(cudaMemcpy(target, source.data(), count * sizeof(T), cudaMemcpyHostToDevice),
        "scene upload");
}

}  // namespace

ClusterMemory::ClusterMemory(std::size_t cluster_count, std::size_t bytes_of_blocks) {
  blocks.reserve(bytes_of_blocks);
  units.reserve(cluster_count);
  clusters.reserve(cluster_count);
}

SceneArrays ClusterMemory::arrays(std::size_t gaussians, int sh_degree) const {
  const auto cluster_count = static_cast<std::uint32_t>(clusters_of(gaussians));
  return {.count = static_cast<std::uint32_t>(gaussians),
          .cluster_count = cluster_count,
          .frame_clusters = cluster_count,
          .sh_degree = sh_degree,
          .block_bytes = static_cast<std::uint32_t>(packed_block_bytes(sh_degree)),
          .blocks = blocks.get(),
          .units = units.get(),
          .clusters = clusters.get()};
}

ClusterMemory upload(const SceneSource& source) {
  const GaussianCloud& cloud = source.cloud;
  const std::span<const std::uint32_t> order = source.order;
  assert(order.size() == cloud.size());
  const std::size_t clusters = clusters_of(order.size());
  const std::size_t block_bytes = packed_block_bytes(cloud.sh_degree);
  ClusterMemory memory(clusters, clusters * block_bytes);

  std::vector<PackedUnits> units(clusters);
  std::vector<Cluster> bounds(clusters);
  std::vector<std::byte> blocks(std::min(clusters, clusters_per_upload) * block_bytes);
  for (std::size_t first = 0; first < clusters; first += clusters_per_upload) {
    const std::size_t count = std::min(clusters - first, clusters_per_upload);
    std::ranges::fill(blocks, std::byte{});  // the last cluster may not fill its block
    source.pool.parallel_for(count, [&](std::size_t c) {
      const std::size_t begin = (first + c) * cluster_size;
      const PackedCluster packed =
          pack_cluster(cloud, order.subspan(begin, std::min(cluster_size, order.size() - begin)),
                       std::span(blocks).subspan(c * block_bytes, block_bytes));
      units[first + c] = packed.units;
      bounds[first + c] = packed.bounds;
    });
    copy(memory.blocks.get() + first * block_bytes, blocks, count * block_bytes);
  }
  copy(memory.units.get(), units, clusters);
  copy(memory.clusters.get(), bounds, clusters);
  // Copies from pageable memory may return before they have ended, and Views' streams do not wait
  // for them.
  check(cudaStreamSynchronize(cudaStreamLegacy), "scene upload");
  return memory;
}

}  // namespace catgs::cuda
