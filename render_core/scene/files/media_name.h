#pragma once

#include <optional>
#include <string_view>

namespace catgs {

enum class MediaKind { image, video, audio, captions };

/// A format of files that tours may show: what browsers can show, and what cannot hold scripts.
struct MediaType {
  std::string_view content_type;
  MediaKind kind;
};

namespace media_types {
inline constexpr MediaType jpeg{"image/jpeg", MediaKind::image};
inline constexpr MediaType png{"image/png", MediaKind::image};
inline constexpr MediaType webp{"image/webp", MediaKind::image};
inline constexpr MediaType mp4{"video/mp4", MediaKind::video};
inline constexpr MediaType webm{"video/webm", MediaKind::video};
inline constexpr MediaType mp3{"audio/mpeg", MediaKind::audio};
inline constexpr MediaType m4a{"audio/mp4", MediaKind::audio};
inline constexpr MediaType ogg{"audio/ogg", MediaKind::audio};
inline constexpr MediaType wav{"audio/wav", MediaKind::audio};
inline constexpr MediaType vtt{"text/vtt; charset=utf-8", MediaKind::captions};
}  // namespace media_types

/// The extension of the folder beside a scene that holds the media of its tours.
inline constexpr std::string_view media_folder_extension = ".media";

/// Whether a text is the name of a file of a media folder: 1 to 100 letters, digits and `._-`,
/// without a dot at its beginning.
bool is_media_name(std::string_view name);

/// The format that the extension of a name or an address promises; null: no known extension.
const MediaType* media_type_named(std::string_view name);
std::optional<MediaKind> media_kind_named(std::string_view name);

}  // namespace catgs
