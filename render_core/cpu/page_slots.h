#pragma once

#include <memory>

#include "render_core/cpu/scene_store.h"
#include "render_core/frame/renderer.h"
#include "render_core/scene/tree/paged_tree.h"

namespace catgs {

/// The pool of pages in main memory for a tree of this shape: the one of `options.pages`, or one of
/// its own.
std::shared_ptr<PagePool> host_pool(const TreeShape& shape, const RendererOptions& options);

/// The pages of a tree in a SceneStore: slot s has the clusters from s * TreeShape::slots() on.
/// Each tree has a store of its own with room for all slots of the pool, but only its pages take
/// memory.
class PageSlots final : public PageStore {
 public:
  PageSlots(const TreeShape& shape, SplatModel model, std::uint32_t slots)
      : shape_(shape), store_(slots * shape.slots(), shape.sh_degree(), model) {}

  [[nodiscard]] const SceneStore& store() const { return store_; }
  void put(std::uint32_t slot, const TreePage& page, std::uint64_t number) override;
  void publish(PageTable& /*table*/) override {}
  void release(std::uint32_t slot) override {
    store_.forget(slot * shape_.slots(), shape_.slots());
  }

 private:
  const TreeShape& shape_;
  SceneStore store_;
};

}  // namespace catgs
