#pragma once

#include <cstddef>

namespace catgs {

/// Indices of values in ascending order.
struct CalmRange {
  std::size_t first, last;
};

/// The values that are not far from all others: from those but `most` at either end, outwards
/// across gaps of at most `widest` of the range so far. `value` tells the value of an index; only
/// those of the `most` + 1 first and last are asked for. There are more than 2 `most`.
template <class Value>
CalmRange calm_range(std::size_t count, std::size_t most, float widest, const Value& value) {
  CalmRange calm{most, count - 1 - most};
  for (bool wider = true; wider;) {
    const float gap = widest * (value(calm.last) - value(calm.first));
    wider = false;
    if (calm.first > 0 && value(calm.first) - value(calm.first - 1) <= gap) {
      --calm.first;
      wider = true;
    }
    if (calm.last + 1 < count && value(calm.last + 1) - value(calm.last) <= gap) {
      ++calm.last;
      wider = true;
    }
  }
  return calm;
}

}  // namespace catgs
