#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include <glm/vec3.hpp>

namespace catgs {

/// The unit vector along an axis with this name: "-y", "+z", "z". Empty for other texts.
inline std::optional<glm::vec3> axis_named(std::string_view name) {
  const bool is_signed = name.starts_with('+') || name.starts_with('-');
  const std::string_view letter = name.substr(is_signed ? 1 : 0);
  const std::size_t k = letter.size() == 1 ? std::string_view("xyz").find(letter) : 3;
  if (k >= 3) return std::nullopt;
  glm::vec3 axis(0.0f);
  axis[static_cast<int>(k)] = name.starts_with('-') ? -1.0f : 1.0f;
  return axis;
}

}  // namespace catgs
