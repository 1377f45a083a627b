#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "render_core/cuda/device_scene.cuh"
#include "render_core/cuda/stream.h"
#include "render_core/cuda/tree_cut.h"
#include "render_core/frame/renderer.h"
#include "render_core/scene/tree/paged_tree.h"

namespace catgs::cuda {

/// The pool of pages of one device. Slot s has the clusters from s * clusters_per_slot on.
class DevicePool final : public PagePool {
 public:
  /// Allocates on the current device. `block_bytes`: of all blocks of the largest page. Throws
  /// CudaError.
  DevicePool(std::uint32_t slots, std::size_t block_bytes, int settling_turns);

  /// Bytes of a slot with so many bytes of blocks.
  [[nodiscard]] static std::size_t slot_bytes(std::size_t block_bytes);
  [[nodiscard]] const ClusterMemory& memory() const { return memory_; }
  [[nodiscard]] float* errors() const { return errors_.get(); }
  [[nodiscard]] std::size_t chunk_bytes() const { return memory_.blocks.bytes() / slots(); }

 private:
  ClusterMemory memory_;
  DeviceBuffer<float> errors_;
};

/// The pages of a tree in the slots of a pool. They are copied on a stream of their own.
class DevicePages final : public PageStore {
 public:
  /// `pool` is on `device`, the current one. `shape` must outlive the pages.
  DevicePages(const TreeShape& shape, const DevicePool& pool, int device);

  [[nodiscard]] SceneArrays arrays() const;
  /// The tree as a table's frames see it. Valid as long as the table.
  [[nodiscard]] TreeArrays tree(const PageTable& table) const;

  void put(std::uint32_t slot, const TreePage& page, std::uint64_t number) override;
  void publish(PageTable& table) override;
  void release(std::uint32_t /*slot*/) override {}

 private:
  using Entries = DeviceBuffer<PageEntry>;  // [most_pages_]
  /// Buffers that no table uses. Freeing one would wait for the whole device.
  struct Spares {
    std::mutex mutex;
    std::vector<std::unique_ptr<Entries>> buffers;
  };
  std::unique_ptr<Entries> take_entries();

  const TreeShape& shape_;
  const DevicePool& pool_;
  int device_;
  std::uint32_t most_pages_;  // in a table
  Stream stream_;
  std::shared_ptr<Spares> spares_ = std::make_shared<Spares>();
};

/// One scene on one device, shared by all Views: whole, or in pages.
class DeviceScene {
 public:
  /// Allocate on the current device. Throw CudaError, and for a tree InputError if its first page
  /// cannot be read. A tree takes the memory for pages from the options.
  explicit DeviceScene(const SceneSource& source);
  DeviceScene(std::shared_ptr<TreeFile> tree, const RendererOptions& options, int device);

  [[nodiscard]] const SceneArrays& arrays() const { return arrays_; }
  [[nodiscard]] std::size_t bytes() const { return whole_ ? whole_->bytes() : pool_->bytes(); }
  /// Null for whole scenes.
  [[nodiscard]] PagedTree* tree() const { return tree_.get(); }
  /// For a scene in pages.
  [[nodiscard]] TreeArrays tree(const PageTable& table) const { return pages_->tree(table); }

 private:
  std::optional<ClusterMemory> whole_;
  std::shared_ptr<DevicePool> pool_;
  std::unique_ptr<DevicePages> pages_;
  SceneArrays arrays_;
  std::unique_ptr<PagedTree> tree_;
};

}  // namespace catgs::cuda
