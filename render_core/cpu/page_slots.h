#pragma once

#include "render_core/cpu/scene_store.h"
#include "render_core/scene/tree/tree_pager.h"

namespace catgs {

/// The pages of a tree in a SceneStore: slot s has the clusters from s * TreeShape::slots() on.
class PageSlots final : public PageStore {
 public:
  /// `memory_bytes` bounds the store, but it has room for the fewest pages that a pager needs.
  PageSlots(const TreeShape& shape, std::uint64_t memory_bytes);

  [[nodiscard]] const SceneStore& store() const { return store_; }
  [[nodiscard]] std::uint32_t slots() const override { return slots_; }
  void put(std::uint32_t slot, const TreePage& page, std::uint64_t number) override;
  void publish(PageTable& /*table*/) override {}

 private:
  const TreeShape& shape_;
  std::uint32_t slots_;
  SceneStore store_;
};

}  // namespace catgs
