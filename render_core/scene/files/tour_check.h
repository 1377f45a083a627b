#pragma once

#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/scene/files/hints.h"
#include "render_core/scene/formats/json_field.h"

namespace catgs {

/// Sites that the media of tours may be at, like "https://media.example".
using MediaOrigins = std::vector<std::string>;

inline constexpr std::size_t max_portal_bytes = 128;  // of the id of a scene that one leads to

/// Checks the texts of something in other languages: {"translations": {"de": {"title": …}}}. Throws
/// InputError that names the field.
void check_translations(const JsonField& item, std::initializer_list<std::string_view> texts);

/// Checks the tours and measures of a sidecar, more strictly than pages do: every field must be
/// known, of the right type and within bounds. Media are files of the scene's folder, or addresses
/// at `media_origins`; null: at any site. Throws InputError that names the field.
void check_page_fields(const JsonField& sidecar, const MediaOrigins* media_origins);

/// Begins the warning about a mistake that check_page_fields() finds in a file.
inline constexpr std::string_view faulty_for_pages =
    "pages may not show all of its tours and measures: ";

/// Checks the tours and measures of a scene, with media at any site. Returns the warning about the
/// first mistake; nothing if there is none.
std::optional<std::string> mistake_for_pages(const HintFiles& files);

}  // namespace catgs
