#include "render_core/scene/files/media_name.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <utility>

namespace catgs {
namespace {

using namespace media_types;

constexpr std::array<std::pair<std::string_view, const MediaType*>, 11> extensions = {
    {{"jpg", &jpeg},
     {"jpeg", &jpeg},
     {"png", &png},
     {"webp", &webp},
     {"mp4", &mp4},
     {"webm", &webm},
     {"mp3", &mp3},
     {"m4a", &m4a},
     {"ogg", &ogg},
     {"wav", &wav},
     {"vtt", &vtt}}};

}  // namespace

bool is_media_name(std::string_view name) {
  constexpr std::size_t max_name_bytes = 100;
  return !name.empty() && name.size() <= max_name_bytes && name.front() != '.' &&
         std::ranges::all_of(name, [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '.' || c == '_' || c == '-';
         });
}

const MediaType* media_type_named(std::string_view name) {
  const auto dot = name.rfind('.');
  if (dot == name.npos) return nullptr;
  std::string extension(name.substr(dot + 1));
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  const auto found =
      std::ranges::find(extensions, extension, [](const auto& e) { return e.first; });
  return found == extensions.end() ? nullptr : found->second;
}

std::optional<MediaKind> media_kind_named(std::string_view name) {
  const MediaType* type = media_type_named(name);
  return type ? std::optional(type->kind) : std::nullopt;
}

}  // namespace catgs
