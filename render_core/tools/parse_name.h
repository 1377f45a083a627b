#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"

namespace catgs {

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
