#include "render_core/cpu/page_slots.h"

#include <algorithm>
#include <vector>

#include "render_core/scene/tree/page_pools.h"

namespace catgs {

namespace {

std::size_t slot_bytes(const TreeShape& shape) {
  return shape.slots() * SceneStore::cluster_bytes(shape.sh_degree());
}

}  // namespace

std::shared_ptr<PagePool> host_pool(const TreeShape& shape, const RendererOptions& options) {
  if (!options.pages) {
    const std::uint32_t slots = slots_in(options.scene_memory, slot_bytes(shape), shape);
    return std::make_shared<PagePool>(slots, slots * slot_bytes(shape));
  }
  return options.pages->on(PagePools::host, [&] {
    std::size_t largest = 0;
    for (int degree = 0; degree <= max_sh_degree; ++degree)
      largest = std::max(largest, slot_bytes(TreeShape(1, degree)));
    const auto slots = static_cast<std::uint32_t>(
        std::max<std::uint64_t>(PageChoice::least_slots, options.pages->memory_bytes() / largest));
    return std::make_shared<PagePool>(slots, slots * largest, PagePools::settling_turns);
  });
}

void PageSlots::put(std::uint32_t slot, const TreePage& page, std::uint64_t number) {
  GaussianCloud cloud;
  cloud.resize(cluster_size, shape_.sh_degree());
  std::vector<math::CovarianceFactor<double>> factors;
  for_each_node_in(shape_, number, [&](NodeId node) {
    const std::size_t s = shape_.slot_of(node);
    const NodeFacts& facts = page.facts(s);
    factors.resize(facts.count);
    unpack_cluster(page.block(s), facts.units, facts.count, cloud, 0, factors);
    // Any order of equal depths will do that is the same in all slots.
    const auto first = static_cast<std::uint32_t>((number * shape_.slots() + s) * cluster_size);
    store_.put(slot * shape_.slots() + s, cloud, factors, first);
  });
}

}  // namespace catgs
