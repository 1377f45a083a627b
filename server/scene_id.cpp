#include "server/scene_id.h"

#include <numeric>

#include <fmt/format.h>

#include "render_core/base/printable.h"

namespace catgs {

bool is_scene_id(std::string_view text) {
  return !text.empty() && text.size() <= max_scene_id_bytes && text != "." && text != ".." &&
         printable(text) == text;
}

std::string scene_id_of(std::string_view name,
                        const std::function<bool(const std::string&)>& taken) {
  constexpr std::size_t max_name_bytes = 100;  // a number has room behind it
  std::string base = shortened(printable(name), max_name_bytes);
  if (!is_scene_id(base)) base = "scene";
  if (!taken(base)) return base;
  // By halves: a folder may hold thousands of long names that begin alike.
  const auto numbered = [&](int n) { return fmt::format("{}-{}", base, n); };
  int occupied = 1, free = 2;
  for (; taken(numbered(free)); free *= 2) occupied = free;
  while (free - occupied > 1) {
    const int middle = std::midpoint(occupied, free);
    (taken(numbered(middle)) ? occupied : free) = middle;
  }
  return numbered(free);
}

}  // namespace catgs
