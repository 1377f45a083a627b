#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace catgs {

inline constexpr std::size_t max_scene_id_bytes = 128;

/// True if the text is a valid scene id, which appears in links, messages and the log. An id has 1
/// to 128 bytes that printable() leaves unchanged. It is neither "." nor "..", which browsers
/// remove from paths.
[[nodiscard]] bool is_scene_id(std::string_view text);

/// The name of a scene in the form that its id contains. Bytes that no id may contain are escaped,
/// and long names are cut.
[[nodiscard]] std::string scene_name_of(std::string_view name);

/// The id of a scene at a path, "hall-kdfmqrtv": its recognisable name, and eight consonants that
/// encode a digest of its path. No word or date ends like that.
[[nodiscard]] std::string scene_id_of(std::string_view name,
                                      std::span<const unsigned char, 4> path_digest);
/// True if the id has a digest. It then belongs to one path and is never looked up as a name.
[[nodiscard]] bool belongs_to_path(std::string_view id);
/// The id without its digest.
[[nodiscard]] std::string_view name_in(std::string_view id);

/// The error message for a scene that does not exist here.
[[nodiscard]] std::string no_such_scene(std::string_view name);

}  // namespace catgs
