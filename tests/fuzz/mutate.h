#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace catgs::fuzz {

/// What changes draw from.
struct Material {
  std::mt19937_64& random;
  std::span<const std::string> inputs;  // others of the format; not empty
  std::span<const std::string> words;   // of the format

  /// A number of [0, end); 0 where that is empty.
  [[nodiscard]] std::size_t below(std::size_t end) const {
    return end == 0 ? 0 : static_cast<std::size_t>(random() % end);
  }
  [[nodiscard]] bool one_in(std::size_t n) const { return below(n) == 0; }
  template <class Range>
  [[nodiscard]] const auto& any_of(const Range& range) const {
    return range[below(std::size(range))];
  }
};

/// Changes a text a little.
using Change = void (*)(const Material& material, std::string& text);

/// Bits, numbers, words of the format, ranges that are erased, doubled or taken from another input.
void change_bytes(const Material& material, std::string& text);

/// Values of a JSON document that are erased, repeated, replaced by those of another place or input
/// or by ones that parsers err with, other keys, deeper nesting. Changes bytes of what is no JSON.
void change_json(const Material& material, std::string& text);

/// Lines and words of a header of text, up to "end_header", and bytes of what follows it.
void change_header(const Material& material, std::string& text);

/// What stands between the spaces of `text`.
std::vector<std::string> words_of(std::string_view text);

/// One of the material's inputs with a few changes, by `change` where it is not null and by bytes,
/// not longer than `max_bytes`. The same for the same `random`.
std::string mutant(const Material& material, Change change, std::size_t max_bytes);

}  // namespace catgs::fuzz
