#include "server/net/path_pattern.h"

#include <algorithm>
#include <cstddef>

namespace catgs {
namespace {

bool match_from(std::string_view pattern, std::string_view path, std::size_t part,
                PathParts& parts) {
  const std::size_t literal = std::min(pattern.find('{'), pattern.size());
  if (!path.starts_with(pattern.substr(0, literal))) return false;
  pattern.remove_prefix(literal);
  path.remove_prefix(literal);
  if (pattern.empty()) return path.empty();
  const std::size_t end = pattern.find('}');
  const std::string_view name = pattern.substr(0, end);
  const std::string_view rest = pattern.substr(end + 1);
  const std::size_t least = name.ends_with('?') ? 0 : 1;
  const std::size_t most =
      name.ends_with("...") ? path.size() : std::min(path.find('/'), path.size());
  for (std::size_t length = most + 1; length-- > least;) {
    if (!match_from(rest, path.substr(length), part + 1, parts)) continue;
    parts.at(part) = path.substr(0, length);
    return true;
  }
  return false;
}

}  // namespace

std::optional<PathParts> match_path(std::string_view pattern, std::string_view path) {
  PathParts parts;
  return match_from(pattern, path, 0, parts) ? std::optional(parts) : std::nullopt;
}

}  // namespace catgs
