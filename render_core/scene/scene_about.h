#pragma once

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec3.hpp>

namespace catgs {

/// How a visitor moves at first.
enum class CameraMode { unspecified, orbit, fly, walk };

/// The texts about a scene in one language, by its BCP 47 tag.
struct SceneWords {
  std::string language{};
  std::string title{};    // empty: as for all others
  std::string credits{};  // likewise

  bool operator==(const SceneWords&) const = default;
};

/// A scene's author says this about it to visitors. The texts are printable UTF-8; empty: not said.
struct SceneAbout {
  std::string title{};
  std::string credits{};
  std::string licence{};
  CameraMode mode = CameraMode::unspecified;
  std::uint32_t background_rgb = 0;  // 0xRRGGBB, sRGB: shows where no Gaussian is
  float metres_per_unit = 0.0f;      // of world units; 0: not said
  std::vector<SceneWords> translations{};

  bool operator==(const SceneAbout&) const = default;
};

/// Whether a world unit may be so long.
inline bool is_metres_per_unit(float metres) { return metres >= 1e-6f && metres <= 1e6f; }

/// 0xRRGGBB of six hexadecimal digits; nothing for other texts.
inline std::optional<std::uint32_t> parse_rgb(std::string_view digits) {
  std::uint32_t rgb = 0;
  const char* end = digits.data() + digits.size();
  if (digits.size() != 6 || std::from_chars(digits.data(), end, rgb, 16).ptr != end)
    return std::nullopt;
  return rgb;
}

/// Display-referred colour in [0, 1] of 0xRRGGBB.
inline glm::vec3 colour_of(std::uint32_t rgb) {
  return glm::vec3(rgb >> 16 & 0xff, rgb >> 8 & 0xff, rgb & 0xff) / 255.0f;
}

}  // namespace catgs
