#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "render_core/cuda/device_scene.cuh"
#include "render_core/cuda/stream.h"
#include "render_core/cuda/tree_cut.cuh"
#include "render_core/scene/tree/tree_pager.h"

namespace catgs::cuda {

/// The pages of a tree on one device: slot s has the clusters from s * TreeShape::slots() on. Pages
/// are copied on a stream of their own.
class DevicePages final : public PageStore {
 public:
  /// Allocates on the current device, which is `device`. `memory_bytes` bounds the pages, but there
  /// is room for the fewest that a pager needs. Throws CudaError.
  DevicePages(const TreeShape& shape, std::uint64_t memory_bytes, int device);

  [[nodiscard]] SceneArrays arrays() const;
  [[nodiscard]] std::size_t bytes() const;
  /// The tree as a table's frames see it. Valid as long as the table.
  [[nodiscard]] TreeArrays tree(const PageTable& table) const;

  [[nodiscard]] std::uint32_t slots() const override { return slots_; }
  void put(std::uint32_t slot, const TreePage& page, std::uint64_t number) override;
  void publish(PageTable& table) override;

 private:
  using Entries = DeviceBuffer<PageEntry>;  // [slot]
  /// Buffers that no table uses. Freeing one would wait for the whole device.
  struct Spares {
    std::mutex mutex;
    std::vector<std::unique_ptr<Entries>> buffers;
  };
  std::unique_ptr<Entries> take_entries();

  const TreeShape& shape_;
  int device_;
  std::uint32_t slots_;
  Stream stream_;
  ClusterMemory memory_;
  DeviceBuffer<float> errors_;
  std::shared_ptr<Spares> spares_ = std::make_shared<Spares>();
};

/// One scene on one device, shared by all Views: whole, or in pages.
class DeviceScene {
 public:
  /// Allocate on the current device. Throw CudaError, and for a tree InputError if its first page
  /// cannot be read.
  explicit DeviceScene(const SceneSource& source);
  DeviceScene(std::shared_ptr<TreeFile> tree, std::uint64_t memory_bytes, int device);

  [[nodiscard]] const SceneArrays& arrays() const { return arrays_; }
  [[nodiscard]] std::size_t bytes() const { return whole_ ? whole_->bytes() : pages_->bytes(); }
  /// Null for whole scenes.
  [[nodiscard]] TreePager* pager() const { return pager_.get(); }
  /// For a scene in pages.
  [[nodiscard]] TreeArrays tree(const PageTable& table) const { return pages_->tree(table); }

 private:
  std::optional<ClusterMemory> whole_;
  std::unique_ptr<DevicePages> pages_;
  SceneArrays arrays_;
  std::unique_ptr<TreePager> pager_;
};

}  // namespace catgs::cuda
