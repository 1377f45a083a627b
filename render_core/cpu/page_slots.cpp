#include "render_core/cpu/page_slots.h"

#include <vector>

namespace catgs {

PageSlots::PageSlots(const TreeShape& shape, std::uint64_t memory_bytes)
    : shape_(shape),
      slots_(slots_in(memory_bytes, SceneStore::cluster_bytes(shape.sh_degree()), shape)),
      store_(slots_ * shape.slots(), shape.sh_degree()) {}

void PageSlots::put(std::uint32_t slot, const TreePage& page, std::uint64_t number) {
  GaussianCloud cloud;
  cloud.resize(cluster_size, shape_.sh_degree());
  std::vector<math::CovarianceFactor<double>> factors;
  for (std::size_t s = 0; s < shape_.slots(); ++s) {
    const NodeFacts& facts = page.facts(s);
    if (facts.count == 0) continue;
    factors.resize(facts.count);
    unpack_cluster(page.block(s), facts.units, facts.count, cloud, 0, factors);
    // Any order of equal depths will do that is the same in all slots.
    const auto first = static_cast<std::uint32_t>((number * shape_.slots() + s) * cluster_size);
    store_.put(slot * shape_.slots() + s, cloud, factors, first);
  }
}

}  // namespace catgs
