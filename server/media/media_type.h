#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace catgs {

enum class MediaKind { image, video, audio, captions };

/// A format of files that tours may show: what browsers can show, and what cannot hold scripts.
struct MediaType {
  std::string_view content_type;
  MediaKind kind;
};

/// So many bytes of a file tell its type.
inline constexpr std::size_t media_head_bytes = 4096;

/// Recognises a file by its first bytes, whatever its name says; null: none of our formats. A file
/// that is valid in two formats is served as the one that is recognised here.
const MediaType* media_type_of(std::string_view head);

/// Whether a text is the name of a file of a media folder: 1 to 100 letters, digits and `._-`,
/// without a dot at its beginning.
bool is_media_name(std::string_view name);

/// The kind that the extension of a name or an address promises; nothing: no known extension.
std::optional<MediaKind> media_kind_named(std::string_view name);

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
