#include "render_core/scene/formats/format_limits.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/printable.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

void require_count(const ByteSource& file, std::string_view where, std::uint64_t count,
                   std::uint64_t most) {
  if (count == 0) throw InputError(file.name(), where, "there are no Gaussians");
  if (count > most)
    throw InputError(file.name(), where,
                     fmt::format("{} Gaussians announced, at most {} are supported", count, most),
                     "the header is wrong, or split the scene");
}

void require_plausible_count(const ByteSource& file, std::string_view where, std::uint64_t count,
                             std::size_t plain_bytes, std::uint64_t compressed_bytes,
                             std::uint64_t most) {
  require_count(file, where, count, most);
  if (count > (1 << 16) && count * plain_bytes / max_compression > compressed_bytes)
    throw InputError(
        file.name(), where,
        fmt::format("{} Gaussians cannot be in {} compressed bytes", count, compressed_bytes),
        "the file is cut off or its header is wrong");
}

int sh_degree_of_rest(std::size_t coefficients) {
  for (int degree = 0; degree <= 4; ++degree)
    if (coefficients + 1 == static_cast<std::size_t>((degree + 1) * (degree + 1))) return degree;
  return -1;
}

void add_note(std::vector<std::string>& notes, std::string_view note) {
  constexpr std::size_t most_notes = 32, most_bytes = 320;
  std::string text = printable(shortened(note, most_bytes));
  if (note.size() > most_bytes) text += "…";
  if (notes.size() < most_notes && std::ranges::find(notes, text) == notes.end())
    notes.push_back(std::move(text));
}

std::vector<std::string> notes_of_degree(int degree) {
  if (degree <= max_sh_degree) return {};
  return {fmt::format("its harmonics of degree {} are not shown, only those up to {}", degree,
                      max_sh_degree)};
}

}  // namespace catgs
