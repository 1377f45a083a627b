#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/math/camera.h"

namespace catgs {

/// Whether all of `text` is a number.
template <class Number>
bool parse_whole(std::string_view text, Number& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size();
}

/// `count` numbers with commas between, each at most max_coordinate. Throws InputError for `flag`.
template <std::size_t count>
std::array<double, count> parse_numbers(std::string_view flag, std::string_view text,
                                        std::string_view example) {
  const auto fail = [&] {
    throw InputError(
        flag, "",
        fmt::format("\"{}\" is not {} numbers of at most {}", text, count, max_coordinate),
        fmt::format("like {}={}", flag, example));
  };
  std::array<double, count> numbers{};
  std::string_view rest = text;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    const bool right_end = (comma == rest.size()) == (k + 1 == count);
    if (!right_end || !parse_whole(rest.substr(0, comma), numbers[k])) fail();
    if (!(std::abs(numbers[k]) <= static_cast<double>(max_coordinate))) fail();
    rest.remove_prefix(std::min(comma + 1, rest.size()));
  }
  return numbers;
}

/// The value that a name stands for; `flag` names the source in the InputError, which lists all
/// names.
template <typename Value>
Value parse_name(std::string_view flag, std::string_view name,
                 std::initializer_list<std::pair<std::string_view, Value>> known) {
  std::string names;
  for (const auto& [known_name, value] : known) {
    if (name == known_name) return value;
    names += fmt::format("{}{}", names.empty() ? "one of " : ", ", known_name);
  }
  throw InputError(flag, "", fmt::format("unknown \"{}\"", name), names);
}

}  // namespace catgs
