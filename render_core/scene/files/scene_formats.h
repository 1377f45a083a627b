#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "render_core/scene/formats/scene_format.h"

namespace catgs {

/// The formats, in the order in which is_mine() is asked. Of several index files in a folder, that
/// of the first format counts.
std::span<const SceneFormat* const> scene_formats();

/// The format of a file. Throws InputError, which lists the formats.
const SceneFormat& format_of(const std::filesystem::path& file);

/// The format whose files have an extension; null: none.
const SceneFormat* format_with(std::string_view extension);

/// For error messages.
std::string supported_scenes();

/// The extensions of the formats that are written, for people: ".ply, .sog or .tree".
std::string written_extensions();

}  // namespace catgs
