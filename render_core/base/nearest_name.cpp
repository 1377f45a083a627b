#include "render_core/base/nearest_name.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

namespace catgs {
namespace {

/// Number of letters to insert, delete, change or swap with their neighbour.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1), before, two_before;
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    two_before = std::exchange(before, row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = before[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({before[j] + 1, row[j - 1] + 1, changed});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) row[j] = std::min(row[j], two_before[j - 2] + 1);
    }
  }
  return row.back();
}

}  // namespace

std::string nearest_name(std::string_view unknown, const std::vector<std::string>& names) {
  const bool ends_a_word = !unknown.empty() && unknown.back() != '-';
  const std::string first_words = std::string(unknown) + "-";
  for (const std::string& name : names)
    if (ends_a_word && name.starts_with(first_words)) return name;
  std::string nearest;
  std::size_t least = unknown.size() / 3;
  for (const std::string& name : names) {
    const std::size_t distance = edit_distance(unknown, name);
    if (distance > least || (distance == least && !nearest.empty())) continue;
    least = distance;
    nearest = name;
  }
  return nearest;
}

std::string suggest_name(std::string_view unknown, const std::vector<std::string>& names,
                         std::string_view otherwise) {
  const std::string nearest = nearest_name(unknown, names);
  return nearest.empty() ? std::string(otherwise) : "did you mean " + nearest + "?";
}

}  // namespace catgs
