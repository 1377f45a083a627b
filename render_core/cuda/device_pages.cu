#include <algorithm>
#include <limits>
#include <utility>

#include "render_core/cuda/device_pages.cuh"
#include "render_core/cuda/page_upload.h"
#include "render_core/scene/tree/page_pools.h"

namespace catgs::cuda {
namespace {

/// Numbers of Gaussians have 32 bits.
constexpr std::uint32_t most_slots =
    std::numeric_limits<std::uint32_t>::max() / (clusters_per_slot * cluster_size);

/// Chunks are aligned as device memory is.
std::size_t chunk_bytes_for(std::size_t block_bytes) { return (block_bytes + 255) / 256 * 256; }

std::size_t page_block_bytes(const TreeShape& shape) { return shape.slots() * shape.block_bytes(); }

std::shared_ptr<DevicePool> make_pool(std::uint64_t slots, std::size_t block_bytes,
                                      int settling_turns) {
  return std::make_shared<DevicePool>(static_cast<std::uint32_t>(std::clamp<std::uint64_t>(
                                          slots, PageChoice::least_slots, most_slots)),
                                      block_bytes, settling_turns);
}

/// The pool of the options for this device, or one for this tree alone.
std::shared_ptr<DevicePool> pool_for(const TreeShape& shape, const RendererOptions& options,
                                     int device) {
  if (!options.pages) {
    const std::size_t blocks = page_block_bytes(shape);
    return make_pool(slots_in(options.scene_memory, DevicePool::slot_bytes(blocks), shape), blocks,
                     PagePool::all_turns);
  }
  const auto make = [&]() -> std::shared_ptr<PagePool> {
    std::size_t largest = 0;
    for (int degree = 0; degree <= max_sh_degree; ++degree)
      largest = std::max(largest, page_block_bytes(TreeShape(1, degree)));
    return make_pool(options.pages->memory_bytes() / DevicePool::slot_bytes(largest), largest,
                     PagePools::settling_turns);
  };
  return std::static_pointer_cast<DevicePool>(options.pages->on(device, make));
}

}  // namespace

DevicePool::DevicePool(std::uint32_t slots, std::size_t block_bytes, int settling_turns)
    : PagePool(slots, slots * slot_bytes(block_bytes), settling_turns),
      memory_(std::size_t{slots} * clusters_per_slot, slots * chunk_bytes_for(block_bytes)) {
  errors_.reserve(std::size_t{slots} * clusters_per_slot);
}

std::size_t DevicePool::slot_bytes(std::size_t block_bytes) {
  return chunk_bytes_for(block_bytes) +
         clusters_per_slot * (sizeof(PackedUnits) + sizeof(Cluster) + sizeof(float));
}

DevicePages::DevicePages(const TreeShape& shape, const DevicePool& pool, int device)
    : shape_(shape),
      pool_(pool),
      device_(device),
      most_pages_(std::min(pool.slots(), PageChoice::slots_for(shape))) {}

SceneArrays DevicePages::arrays() const {
  const std::uint32_t clusters = pool_.slots() * clusters_per_slot;
  SceneArrays arrays =
      pool_.memory().arrays(std::size_t{clusters} * cluster_size, shape_.sh_degree());
  arrays.frame_clusters = most_pages_ * clusters_per_slot;
  arrays.chunk_shift = slot_shift;
  arrays.chunk_bytes = static_cast<std::uint32_t>(pool_.chunk_bytes());
  return arrays;
}

TreeArrays DevicePages::tree(const PageTable& table) const {
  return {.pages = static_cast<const Entries*>(table.of_core.get())->get(),
          .page_count = static_cast<std::uint32_t>(table.size()),
          .errors = pool_.errors()};
}

void DevicePages::put(std::uint32_t slot, const TreePage& page, std::uint64_t number) {
  check(cudaSetDevice(device_), "device");
  const PageUpload upload(shape_, page, number);
  const std::size_t first = std::size_t{slot} * clusters_per_slot;
  const auto copy = [&](auto* target, const auto& source) {
    check(cudaMemcpyAsync(target, source.data(), source.size() * sizeof(source[0]),
                          cudaMemcpyHostToDevice, stream_.get()),
          "page upload");
  };
  copy(pool_.memory().blocks.get() + slot * pool_.chunk_bytes(), upload.blocks);
  copy(pool_.memory().units.get() + first, upload.units);
  copy(pool_.memory().clusters.get() + first, upload.clusters);
  copy(pool_.errors() + first, upload.errors);
}

std::unique_ptr<DevicePages::Entries> DevicePages::take_entries() {
  {
    const std::lock_guard lock(spares_->mutex);
    if (!spares_->buffers.empty()) {
      auto entries = std::move(spares_->buffers.back());
      spares_->buffers.pop_back();
      return entries;
    }
  }
  auto entries = std::make_unique<Entries>();
  entries->reserve(most_pages_);
  return entries;
}

void DevicePages::publish(PageTable& table) {
  check(cudaSetDevice(device_), "device");
  const std::vector<PageEntry> entries = entries_of(table);
  auto on_device = take_entries();
  check(cudaMemcpyAsync(on_device->get(), entries.data(), entries.size() * sizeof(PageEntry),
                        cudaMemcpyHostToDevice, stream_.get()),
        "page table upload");
  check(cudaStreamSynchronize(stream_.get()), "page upload");
  table.of_core = std::shared_ptr<const Entries>(
      on_device.release(), [spares = spares_](const Entries* entries_) {
        const std::lock_guard lock(spares->mutex);
        spares->buffers.emplace_back(const_cast<Entries*>(entries_));
      });
}

DeviceScene::DeviceScene(const SceneSource& source)
    : whole_(upload(source)), arrays_(whole_->arrays(source.order.size(), source.cloud.sh_degree)) {
  arrays_.antialiased = source.cloud.model == SplatModel::antialiased;
}

DeviceScene::DeviceScene(std::shared_ptr<TreeFile> tree, const RendererOptions& options, int device)
    : pool_(pool_for(tree->shape(), options, device)),
      pages_(std::make_unique<DevicePages>(tree->shape(), *pool_, device)),
      arrays_(pages_->arrays()) {
  arrays_.antialiased = tree->model() == SplatModel::antialiased;
  tree_ = std::make_unique<PagedTree>(pool_, std::move(tree), *pages_);
}

}  // namespace catgs::cuda
