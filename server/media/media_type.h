#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "render_core/scene/files/media_name.h"

namespace catgs {

/// So many bytes of a file tell its type.
inline constexpr std::size_t media_head_bytes = 4096;

/// Recognises a file by its first bytes, whatever its name says; null: none of our formats. A file
/// that is valid in two formats is served as the one that is recognised here.
const MediaType* media_type_of(std::string_view head);

/// A format of cameras that tours do not show.
struct OtherFormat {
  std::string_view name, instead, extensions, brands;
};
/// Known by a file's extension or its first bytes; null: none of these.
const OtherFormat* other_format(std::string_view name, std::string_view head);

struct PixelSize {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
};

/// The size of a JPEG, PNG or WebP file, as its headers state it; nothing: they do not.
std::optional<PixelSize> image_size(std::string_view content);

inline constexpr std::size_t max_media_bytes = 64 << 20;
inline constexpr std::uint32_t max_picture_side_px = 8192;

/// Checks a file before it is kept under `name`: its content must be of a known format, of that of
/// its extension, and within the bounds. Throws InputError with the remedy.
void check_media(std::string_view name, std::string_view content);

}  // namespace catgs
