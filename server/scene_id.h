#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

namespace catgs {

inline constexpr std::size_t max_scene_id_bytes = 128;

/// A scene's id stands in links, in messages and in the log. It is 1 to 128 bytes of text that
/// printable() leaves as it is, and neither "." nor "..", which browsers take out of a path.
[[nodiscard]] bool is_scene_id(std::string_view text);

/// The id of a scene with this name, by which people recognise it in a link. What no id may hold
/// comes out by its bytes, the end of a long name is left out, and a second scene of a name gets a
/// number.
[[nodiscard]] std::string scene_id_of(std::string_view name,
                                      const std::function<bool(const std::string&)>& taken);

}  // namespace catgs
