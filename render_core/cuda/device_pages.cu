#include <algorithm>
#include <cstring>
#include <limits>
#include <unordered_map>
#include <utility>

#include "render_core/cuda/device_pages.cuh"
#include "render_core/scene/tree/page_pools.h"

namespace catgs::cuda {
namespace {

constexpr double never_s = std::numeric_limits<double>::infinity();

/// Numbers of Gaussians have 32 bits.
constexpr std::uint32_t most_slots =
    std::numeric_limits<std::uint32_t>::max() / (clusters_per_slot * cluster_size);

/// The largest level of log2_opacity, which is below visibility.
constexpr std::uint16_t invisible = 65535;

/// Kernels draw all Gaussians of a block, so those that the node does not have become invisible.
void hide_rest(std::byte* block, std::size_t count) {
  for (std::size_t i = count; i < cluster_size; ++i)
    std::memcpy(block + packed_offset(0, 16, static_cast<std::uint32_t>(i)) +
                    offsetof(PackedGeometry, log2_opacity),
                &invisible, sizeof invisible);
}

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

/// Rows of nodes above the last one of the pages of a band.
int rows_above_bottom(const TreeShape& shape, int band) {
  return shape.top_level(band) - band * shape.page_levels();
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

void DevicePages::put(std::uint32_t slot, const TreePage& page, std::uint64_t /*number*/) {
  check(cudaSetDevice(device_), "device");
  const std::size_t nodes = shape_.slots(), first = std::size_t{slot} * clusters_per_slot;
  const auto whole = page.bytes().subspan(shape_.block_offset(0), nodes * shape_.block_bytes());
  std::vector<std::byte> blocks(whole.begin(), whole.end());
  std::vector<PackedUnits> units(clusters_per_slot);
  std::vector<Cluster> clusters(clusters_per_slot);
  std::vector<float> errors(clusters_per_slot, -1.0f);
  for (std::size_t s = 0; s < nodes; ++s) {
    const NodeFacts& facts = page.facts(s);
    if (facts.count == 0) continue;
    units[s] = facts.units;
    clusters[s] = facts.bounds;
    errors[s] = facts.error;
    hide_rest(blocks.data() + s * shape_.block_bytes(), facts.count);
  }
  const auto copy = [&](auto* target, const auto& source) {
    check(cudaMemcpyAsync(target, source.data(), source.size() * sizeof(source[0]),
                          cudaMemcpyHostToDevice, stream_.get()),
          "page upload");
  };
  copy(pool_.memory().blocks.get() + slot * pool_.chunk_bytes(), blocks);
  copy(pool_.memory().units.get() + first, units);
  copy(pool_.memory().clusters.get() + first, clusters);
  copy(pool_.errors() + first, errors);
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

/// In the order of the pages' numbers, so that the order of equal depths does not depend on slots.
std::vector<PageEntry> DevicePages::entries_of(const PageTable& table) const {
  std::vector<const PageInSlot*> pages;
  for (const auto& page : table.pages()) pages.push_back(page.get());
  std::ranges::sort(pages, {}, &PageInSlot::page);
  std::unordered_map<std::uint64_t, std::size_t> place_of;
  for (std::size_t i = 0; i < pages.size(); ++i) place_of[pages[i]->page] = i;
  std::vector<PageEntry> entries(pages.size());
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const PageInSlot& page = *pages[i];
    const int band = shape_.band_of_page(page.page);
    entries[i] = {.shown_since_s = page.shown_since_s,
                  .below_since_s = {},
                  .slot = page.slot,
                  .above = PageEntry::no_node,
                  .first_bottom = (1u << rows_above_bottom(shape_, band)) - 1u,
                  .top_level = static_cast<std::uint32_t>(shape_.top_level(band))};
    std::ranges::fill(entries[i].below_since_s, never_s);
  }
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const PageInSlot* above = table.above(pages[i]->page);
    if (above == nullptr) continue;
    const NodeId root = shape_.root_of(pages[i]->page);
    const auto refined = static_cast<std::uint32_t>(
        shape_.slot_of({static_cast<std::uint8_t>(root.level + 1), root.index / 2}));
    entries[i].above = above->slot * clusters_per_slot + refined;
    PageEntry& entry_above = entries[place_of.at(above->page)];
    entry_above.below_since_s[refined - entry_above.first_bottom] = pages[i]->shown_since_s;
  }
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
