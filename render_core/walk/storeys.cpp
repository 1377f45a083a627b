#include "render_core/walk/storeys.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace catgs::walk {

std::vector<Storey> find_storeys(const WalkMap& map) {
  constexpr std::size_t bins = grid_levels;  // a cell each
  constexpr double small = 0.02;             // of all clear ground
  constexpr double little = 0.1;             // of the smaller of two storeys, in a bin between them
  std::array<std::uint32_t, bins> area{};
  std::uint32_t total = 0;
  for (const Position& position : map.positions)
    if (position.kind == Kind::clear) {
      ++area[position.height / static_cast<std::size_t>(Position::per_cell)];
      ++total;
    }
  const auto of = [&](std::size_t bin) {  // a floor may lie on the border of two bins
    return bin + 1 < bins ? area[bin] + area[bin + 1] : area[bin];
  };
  std::vector<std::size_t> levels;  // from below
  const auto apart = static_cast<std::size_t>(0.75f * Person::in_cells(map.person.height));
  for (std::size_t bin = 0; bin < bins; ++bin) {
    if (of(bin) < small * total) continue;
    if (levels.empty()) {
      levels.push_back(bin);
      continue;
    }
    std::size_t& last = levels.back();
    std::uint32_t least = of(last);
    for (std::size_t k = last; k < bin; ++k) least = std::min(least, of(k));
    if (bin - last >= apart && least < little * std::min(of(bin), of(last)))
      levels.push_back(bin);
    else if (of(bin) > of(last))
      last = bin;
  }
  std::vector<Storey> storeys;
  for (const std::size_t level : levels) {
    const float height = static_cast<float>(level) + 1.0f;
    storeys.push_back(
        {storeys.empty() ? 0.0f : height - Person::in_cells(map.person.step), height});
  }
  if (storeys.empty()) storeys.push_back({});
  std::size_t storey = 0;
  for (std::size_t bin = 0; bin < bins; ++bin) {
    while (storey + 1 < storeys.size() && static_cast<float>(bin) >= storeys[storey + 1].low)
      ++storey;
    storeys[storey].area += area[bin];
  }
  return storeys;
}

}  // namespace catgs::walk
