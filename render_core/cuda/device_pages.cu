#include <algorithm>
#include <cstring>
#include <limits>

#include "render_core/cuda/device_pages.cuh"

namespace catgs::cuda {
namespace {

constexpr double never_s = std::numeric_limits<double>::infinity();

/// The largest level of log2_opacity, which is below visibility.
constexpr std::uint16_t invisible = 65535;

/// Kernels draw all Gaussians of a block, so those that the node does not have become invisible.
void hide_rest(std::byte* block, std::size_t count) {
  for (std::size_t i = count; i < cluster_size; ++i)
    std::memcpy(block + packed_offset(0, 16, static_cast<std::uint32_t>(i)) +
                    offsetof(PackedGeometry, log2_opacity),
                &invisible, sizeof invisible);
}

}  // namespace

DevicePages::DevicePages(const TreeShape& shape, std::uint64_t memory_bytes, int device)
    : shape_(shape),
      device_(device),
      slots_(slots_in(memory_bytes,
                      shape.block_bytes() + sizeof(PackedUnits) + sizeof(Cluster) + sizeof(float),
                      shape)),
      memory_(slots_ * shape.slots(), shape.sh_degree()) {
  errors_.reserve(slots_ * shape.slots());
}

SceneArrays DevicePages::arrays() const {
  return memory_.arrays(slots_ * shape_.slots() * cluster_size);
}

std::size_t DevicePages::bytes() const {
  return memory_.bytes() + errors_.bytes() + slots_ * sizeof(PageEntry);
}

TreeArrays DevicePages::tree(const PageTable& table) const {
  return {.pages = static_cast<const Entries*>(table.of_core.get())->get(),
          .errors = errors_.get(),
          .nodes_per_page = static_cast<std::uint32_t>(shape_.slots())};
}

void DevicePages::put(std::uint32_t slot, const TreePage& page, std::uint64_t /*number*/) {
  check(cudaSetDevice(device_), "device");
  const std::size_t nodes = shape_.slots(), first = slot * nodes;
  const auto whole = page.bytes().subspan(shape_.block_offset(0), nodes * shape_.block_bytes());
  std::vector<std::byte> blocks(whole.begin(), whole.end());
  std::vector<PackedUnits> units(nodes);
  std::vector<Cluster> clusters(nodes);
  std::vector<float> errors(nodes, -1.0f);
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
  copy(memory_.blocks.get() + first * shape_.block_bytes(), blocks);
  copy(memory_.units.get() + first, units);
  copy(memory_.clusters.get() + first, clusters);
  copy(errors_.get() + first, errors);
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
  entries->reserve(slots_);
  return entries;
}

void DevicePages::publish(PageTable& table) {
  check(cudaSetDevice(device_), "device");
  std::vector<PageEntry> entries(slots_);
  for (PageEntry& entry : entries) {
    entry = {.shown_since_s = never_s,
             .below_since_s = {},
             .above = PageEntry::no_node,
             .first_bottom = 0};
    std::ranges::fill(entry.below_since_s, never_s);
  }
  for (const auto& page : table.pages()) {
    if (!page) continue;
    PageEntry& entry = entries[page->slot];
    entry.shown_since_s = page->shown_since_s;
    const int band = shape_.band_of_page(page->page);
    const int rows = shape_.top_level(band) - band * shape_.page_levels();
    entry.first_bottom = (1u << rows) - 1u;
    const PageInSlot* above = table.above(page->page);
    if (above == nullptr) continue;
    const NodeId root = shape_.root_of(page->page);
    const auto refined = static_cast<std::uint32_t>(
        shape_.slot_of({static_cast<std::uint8_t>(root.level + 1), root.index / 2}));
    entry.above = above->slot * static_cast<std::uint32_t>(shape_.slots()) + refined;
    const int above_band = band + 1;
    const int above_rows = shape_.top_level(above_band) - above_band * shape_.page_levels();
    entries[above->slot].below_since_s[refined - ((1u << above_rows) - 1u)] = page->shown_since_s;
  }
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
    : whole_(upload(source)), arrays_(whole_->arrays(source.order.size())) {}

DeviceScene::DeviceScene(std::shared_ptr<TreeFile> tree, std::uint64_t memory_bytes, int device)
    : pages_(std::make_unique<DevicePages>(tree->shape(), memory_bytes, device)),
      arrays_(pages_->arrays()),
      pager_(std::make_unique<TreePager>(std::move(tree), *pages_)) {}

}  // namespace catgs::cuda
