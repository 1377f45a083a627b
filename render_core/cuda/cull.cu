#include <algorithm>

#include <cub/device/device_scan.cuh>
#include <cub/device/device_select.cuh>
#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/cull.cuh"

namespace catgs::cuda {
namespace {

/// A block takes one cluster after another. The number of clusters in sight is known on the device
/// only, and the host does not wait for it.
constexpr int block_size = cluster_size;
constexpr int warps = block_size / warp_size;
constexpr int blocks_per_processor = 8;

/// Whether a cluster is behind what the last frame shows.
__device__ bool is_hidden(const CullParams& p, const Cluster& cluster) {
  if (p.occlusion.part == nullptr) return false;
  const glm::vec3 &c = cluster.centre, &h = cluster.half_extent;
  const auto box_in = [&](const math::CameraModel<float>& camera) {
    return math::cluster_box<float>(camera, {c.x, c.y, c.z}, {h.x, h.y, h.z}, cluster.reach);
  };
  auto box = box_in(p.camera.now.single);
  const float nearest = box.nearest;
  if (p.sweeps) {
    const auto end = box_in(p.camera.end);
    if (!(end.nearest > 0.0f)) return false;
    box.low_px = {fminf(box.low_px.x, end.low_px.x), fminf(box.low_px.y, end.low_px.y)};
    box.high_px = {fmaxf(box.high_px.x, end.high_px.x), fmaxf(box.high_px.y, end.high_px.y)};
  }
  return nearest > 0.0f && p.occlusion.hides(p.shape, make_float2(box.low_px.x, box.low_px.y),
                                             make_float2(box.high_px.x, box.high_px.y), nearest);
}

// Separate from the selection kernel, whose few blocks would test one cluster after another.
__global__ void __launch_bounds__(block_size) sight_kernel(const CullParams p) {
  const std::uint32_t n = blockIdx.x * block_size + threadIdx.x;
  if (n >= p.count()) return;
  const std::uint32_t c = p.cut ? p.cut->tree.cluster_of(n) : n;
  bool drawn = true;
  if (p.cut) {
    const float share = p.cut->share_of(p.scene.clusters, n);
    p.cut->share[c] = share;
    drawn = share > 0.0f;
  }
  const Cluster& cluster = p.scene.clusters[c];
  const bool seen = drawn && !p.culler.outside(cluster) && !is_hidden(p, cluster);
  p.seen[n] = seen ? 1 : 0;
  if (!p.cut) return;
  // The threads of a warp have the nodes of one page.
  static_assert(clusters_per_slot == warp_size);
  const unsigned levels = __reduce_or_sync(~0u, seen ? 1u << p.cut->level_of(n) : 0u);
  if (threadIdx.x % warp_size == 0 && (levels & ~p.counts->levels) != 0)
    atomicOr(&p.counts->levels, levels);
}

/// The cluster that is the n-th that a frame looks at.
struct ClusterAt {
  TreeArrays tree;  // without pages, clusters are looked at in their order
  __device__ std::uint32_t operator()(std::uint32_t n) const {
    return tree.pages == nullptr ? n : tree.cluster_of(n);
  }
};

template <bool sweeps>
__global__ void __launch_bounds__(block_size) mask_kernel(const CullParams p) {
  const std::uint32_t clusters = p.counts->clusters;
  for (std::uint32_t rank = blockIdx.x; rank < clusters; rank += gridDim.x) {
    const std::uint32_t i = p.clusters[rank] * block_size + threadIdx.x;
    bool visible = false;
    if (i < p.scene.count) {
      const Splat splat =
          make_splat<sweeps>(p.scene, p.camera, p.shape, i, load_centre(p.scene, i));
      visible =
          splat.in_view && !p.occlusion.hides(p.shape, splat.low_px, splat.high_px, splat.depth);
    }
    const unsigned word = __ballot_sync(~0u, visible);
    if (threadIdx.x % warp_size == 0) p.mask[rank * warps + threadIdx.x / warp_size] = word;
    const int seen = __syncthreads_count(visible);
    if (threadIdx.x == 0) p.seen[rank] = static_cast<std::uint32_t>(seen);
  }
}

/// seen[rank], and 0 beyond the clusters in sight.
struct Seen {
  const std::uint32_t* seen;
  const FrameCounts* counts;
  __device__ std::uint32_t operator()(std::uint32_t rank) const {
    return rank < counts->clusters ? seen[rank] : 0;
  }
};

__global__ void __launch_bounds__(block_size) compact_kernel(const CullParams p) {
  const std::uint32_t clusters = p.counts->clusters;
  const std::uint32_t lane = threadIdx.x % warp_size, warp = threadIdx.x / warp_size;
  for (std::uint32_t rank = blockIdx.x; rank < clusters; rank += gridDim.x) {
    const std::uint32_t* words = &p.mask[rank * warps];
    const int in_lower_warps = __reduce_add_sync(~0u, lane < warp ? __popc(words[lane]) : 0);
    const std::uint32_t word = words[warp];
    const std::uint32_t at = p.before[rank] + static_cast<std::uint32_t>(in_lower_warps) +
                             static_cast<std::uint32_t>(__popc(word & ((1u << lane) - 1u)));
    if ((word >> lane & 1u) != 0 && at < p.shape.visible_bound)
      p.visible[at] = p.clusters[rank] * block_size + threadIdx.x;
    if (rank + 1 == clusters && threadIdx.x == 0) {
      const std::uint32_t visible = p.before[rank] + p.seen[rank];
      p.counts->visible = visible;
      p.host_counts->visible = visible;
    }
  }
}

cudaError_t select_clusters(void* scratch, std::size_t& bytes, const ClusterAt& cluster_at,
                            const std::uint32_t* in_sight, std::uint32_t* clusters,
                            std::uint32_t* selected, std::uint32_t count, cudaStream_t stream) {
  return cub::DeviceSelect::Flagged(
      scratch, bytes,
      thrust::make_transform_iterator(thrust::make_counting_iterator(std::uint32_t{0}), cluster_at),
      in_sight, clusters, selected, count, stream);
}

cudaError_t sum_seen(void* scratch, std::size_t& bytes, const Seen& seen, std::uint32_t* before,
                     std::uint32_t count, cudaStream_t stream) {
  return cub::DeviceScan::ExclusiveSum(
      scratch, bytes,
      thrust::make_transform_iterator(thrust::make_counting_iterator(std::uint32_t{0}), seen),
      before, count, stream);
}

}  // namespace

std::uint32_t cull_words(std::uint32_t cluster_count) { return cluster_count * warps; }

std::size_t cull_scratch_bytes(std::uint32_t cluster_count) {
  std::size_t select = 0, sum = 0;
  check(select_clusters(nullptr, select, {}, nullptr, nullptr, nullptr, cluster_count, nullptr),
        "cull scratch size");
  check(sum_seen(nullptr, sum, {nullptr, nullptr}, nullptr, cluster_count, nullptr),
        "cull scratch size");
  return std::max(select, sum);
}

void launch_cull(const CullParams& p, cudaStream_t stream) {
  const std::uint32_t count = p.count();
  if (count == 0) return;
  sight_kernel<<<blocks_for(count, block_size), block_size, 0, stream>>>(p);
  check_launch("clusters in sight");
  std::size_t bytes = p.scratch.bytes;
  check(select_clusters(p.scratch.memory, bytes, {p.cut ? p.cut->tree : TreeArrays{}}, p.seen,
                        p.clusters, &p.counts->clusters, count, stream),
        "cull clusters");
  const std::uint32_t blocks =
      std::min(count, static_cast<std::uint32_t>(p.processors * blocks_per_processor));
  const auto kernel = p.sweeps ? mask_kernel<true> : mask_kernel<false>;
  kernel<<<blocks, block_size, 0, stream>>>(p);
  check_launch("cull");
  bytes = p.scratch.bytes;
  check(sum_seen(p.scratch.memory, bytes, {p.seen, p.counts}, p.before, count, stream),
        "cull scan");
  compact_kernel<<<blocks, block_size, 0, stream>>>(p);
  check_launch("cull compaction");
}

}  // namespace catgs::cuda
