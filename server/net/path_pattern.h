#pragma once

#include <array>
#include <optional>
#include <string_view>

namespace catgs {

/// The parts of a path that a pattern names, in their order; the others are empty.
using PathParts = std::array<std::string_view, 2>;

/// Returns the named parts of `path`; nothing: the pattern does not match. A pattern is text with
/// at most two names: "{job}" stands for one byte or more without a slash, "{name?}" may also be
/// empty, and "{scene...}" is one byte or more, slashes included, as long as possible.
std::optional<PathParts> match_path(std::string_view pattern, std::string_view path);

}  // namespace catgs
