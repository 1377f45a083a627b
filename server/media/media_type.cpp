#include "server/media/media_type.h"

#include <algorithm>
#include <array>
#include <string>

#include <fmt/format.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

using namespace std::string_view_literals;
using namespace media_types;

constexpr std::string_view formats =
    "tours take JPEG, PNG, WebP, MP4, WebM, MP3, M4A, Ogg, WAV and WebVTT";

/// An unsigned number of `count` bytes at `at`, which must be there.
std::uint32_t big_endian(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i)
    value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}
std::uint32_t little_endian(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = count; i-- > 0;)
    value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

/// ISO 14496-12: a box "ftyp" whose brand names the kind of file. Its size comes first. A larger
/// one than a list of brands needs could be the text of a page.
const MediaType* type_of_brand(std::string_view head) {
  constexpr std::uint32_t most_box_bytes = 4096;
  if (head.size() < 16 || head.substr(4, 4) != "ftyp") return nullptr;
  if (big_endian(head, 0, 4) > most_box_bytes) return nullptr;
  constexpr std::array sounds = {"M4A "sv, "M4B "sv};
  constexpr std::array films = {"isom"sv, "iso2"sv, "iso3"sv, "iso4"sv, "iso5"sv, "iso6"sv,
                                "mp41"sv, "mp42"sv, "avc1"sv, "M4V "sv, "dash"sv, "MSNV"sv};
  const std::string_view brand = head.substr(8, 4);
  if (std::ranges::find(sounds, brand) != sounds.end()) return &m4a;
  return std::ranges::find(films, brand) != films.end() ? &mp4 : nullptr;
}

/// RFC 8794: the header of EBML names the document. Matroska has the same header as WebM.
bool is_webm(std::string_view head) {
  constexpr std::size_t header_bytes = 64;
  return head.starts_with("\x1a\x45\xdf\xa3") &&
         head.substr(0, header_bytes).find("\x42\x82\x84webm") != head.npos;
}

/// RFC 3533, and the first packet of a codec that sounds.
bool is_ogg_sound(std::string_view head) {
  constexpr std::size_t page_header_bytes = 28;  // of a page with one short packet
  if (!head.starts_with("OggS\0"sv) || head.size() < page_header_bytes) return false;
  const std::string_view packet = head.substr(page_header_bytes);
  return packet.starts_with("\x01vorbis") || packet.starts_with("OpusHead") ||
         packet.starts_with(
             "\x7f"
             "FLAC");
}

/// ISO 11172-3: the header of a frame of layer III, or an ID3 tag before it.
bool is_mp3(std::string_view head) {
  if (head.size() < 10) return false;
  if (head.starts_with("ID3")) return true;
  const std::uint32_t header = big_endian(head, 0, 4);
  const std::uint32_t version = header >> 19 & 3, layer = header >> 17 & 3;
  const std::uint32_t bitrate = header >> 12 & 15, rate = header >> 10 & 3;
  return header >> 21 == 0x7ff && version != 1 && layer == 1 && bitrate != 0 && bitrate != 15 &&
         rate != 3;
}

/// The signature of a WebVTT file ends at a blank, a line end or the end of the file.
bool is_captions(std::string_view head) {
  if (head.starts_with("\xef\xbb\xbf")) head.remove_prefix(3);
  constexpr std::string_view signature = "WEBVTT";
  return head.starts_with(signature) &&
         (head.size() == signature.size() || " \t\r\n"sv.find(head[6]) != std::string_view::npos);
}

/// ITU T.81: the segments of a JPEG, up to the frame header, which has the size.
std::optional<PixelSize> jpeg_size(std::string_view content) {
  std::size_t at = 2;
  while (at + 9 <= content.size()) {
    if (content[at] != '\xff') return std::nullopt;
    const auto marker = static_cast<unsigned char>(content[at + 1]);
    if (marker == 0xff) {  // a fill byte
      ++at;
      continue;
    }
    const bool starts_frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (starts_frame)
      return PixelSize{big_endian(content, at + 7, 2), big_endian(content, at + 5, 2)};
    const std::uint32_t length = big_endian(content, at + 2, 2);
    if (marker == 0xda || marker == 0xd9 || length < 2) return std::nullopt;
    at += 2 + length;
  }
  return std::nullopt;
}

std::optional<PixelSize> png_size(std::string_view content) {
  if (content.size() < 24 || content.substr(12, 4) != "IHDR") return std::nullopt;
  return PixelSize{big_endian(content, 16, 4), big_endian(content, 20, 4)};
}

/// RFC 9649: the first chunk of a WebP has the size, in one of three forms.
std::optional<PixelSize> webp_size(std::string_view content) {
  if (content.size() < 30) return std::nullopt;
  const std::string_view chunk = content.substr(12, 4);
  if (chunk == "VP8X")
    return PixelSize{little_endian(content, 24, 3) + 1, little_endian(content, 27, 3) + 1};
  if (chunk == "VP8L" && content[20] == '\x2f') {
    const std::uint32_t sides = little_endian(content, 21, 4);
    return PixelSize{(sides & 0x3fff) + 1, (sides >> 14 & 0x3fff) + 1};
  }
  if (chunk == "VP8 " && content.substr(23, 3) == "\x9d\x01\x2a")
    return PixelSize{little_endian(content, 26, 2) & 0x3fff,
                     little_endian(content, 28, 2) & 0x3fff};
  return std::nullopt;
}

/// Browsers play the same file as a film or as a sound.
bool same_format(const MediaType* a, const MediaType* b) {
  const auto film = [](const MediaType* type) { return type == &m4a ? &mp4 : type; };
  return film(a) == film(b);
}

}  // namespace

const MediaType* media_type_of(std::string_view head) {
  if (head.starts_with("\xff\xd8\xff")) return &jpeg;
  if (head.starts_with("\x89PNG\r\n\x1a\n")) return &png;
  if (head.starts_with("RIFF") && head.size() >= 12) {
    if (head.substr(8, 4) == "WEBP") return &webp;
    if (head.substr(8, 4) == "WAVE") return &wav;
  }
  if (const MediaType* type = type_of_brand(head)) return type;
  if (is_webm(head)) return &webm;
  if (is_ogg_sound(head)) return &ogg;
  if (is_captions(head)) return &vtt;
  return is_mp3(head) ? &mp3 : nullptr;
}

const OtherFormat* other_format(std::string_view name, std::string_view head) {
  static constexpr std::array others = {
      OtherFormat{"HEIC", "JPEG", " .heic .heif ", " heic heix heim heis hevc hevx mif1 msf1 "},
      OtherFormat{"AVIF", "JPEG", " .avif ", " avif avis "},
      OtherFormat{"QuickTime", "MP4", " .mov ", " qt   "}};
  const auto has = [](std::string_view words, std::string_view word) {
    return words.find(fmt::format(" {} ", word)) != std::string_view::npos;
  };
  std::string extension(name.substr(std::min(name.rfind('.'), name.size())));
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  const bool has_brand = head.size() >= 12 && head.substr(4, 4) == "ftyp";
  const auto* const found = std::ranges::find_if(others, [&](const OtherFormat& other) {
    return has(other.extensions, extension) || (has_brand && has(other.brands, head.substr(8, 4)));
  });
  return found == others.end() ? nullptr : found;
}

std::optional<PixelSize> image_size(std::string_view content) {
  const MediaType* type = media_type_of(content);
  if (type == &jpeg) return jpeg_size(content);
  if (type == &png) return png_size(content);
  return type == &webp ? webp_size(content) : std::nullopt;
}

void check_media(std::string_view name, std::string_view content) {
  const std::string file = is_media_name(name) ? std::string(name) : "media";
  if (!is_media_name(name))
    throw InputError(file, {}, "this is no name for it",
                     "use up to 100 letters of a to z, digits, dots, - and _");
  if (content.size() > max_media_bytes)
    throw InputError(file, {}, fmt::format("is larger than {} MiB", max_media_bytes >> 20),
                     "save it at a lower quality");
  if (const OtherFormat* other = other_format(name, content))
    throw InputError(file, {}, fmt::format("is {}, which tours cannot show", other->name),
                     fmt::format("save it as {}", other->instead));
  const MediaType* named = media_type_named(name);
  const MediaType* type = media_type_of(content.substr(0, media_head_bytes));
  if (!named || !type) throw InputError(file, {}, "is of no format that is shown here", formats);
  if (!same_format(named, type))
    throw InputError(
        file, {},
        fmt::format("its content is {}, its name says {}", type->content_type, named->content_type),
        "give it the extension of its format");
  if (type->kind != MediaKind::image) return;
  const auto size = image_size(content);
  if (!size || size->width == 0 || size->height == 0)
    throw InputError(file, {}, "its headers state no size of the picture", "save it again");
  if (size->width > max_picture_side_px || size->height > max_picture_side_px)
    throw InputError(file, {}, fmt::format("has {} x {} pixels", size->width, size->height),
                     fmt::format("make it at most {0} x {0}", max_picture_side_px));
}

}  // namespace catgs
