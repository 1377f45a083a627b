#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace catgs {

/// The model says what the Gaussians of a scene were trained to be. Drawing them as another one is
/// visibly wrong.
enum class SplatModel : std::uint8_t {
  standard,     // the original 3DGS: the low-pass filter widens a Gaussian and keeps its peak
  antialiased,  // Mip-Splatting: it keeps the Gaussian's sum, see antialiased_log2_opacity()
  surfels,      // 2DGS: discs in the plane of the first two axes, drawn as flat Gaussians
};

/// Names in files, flags and reports, in the order of SplatModel.
inline constexpr std::array<std::string_view, 3> splat_model_names = {"default", "antialiased",
                                                                      "2dgs"};

constexpr std::string_view name_of(SplatModel model) {
  return splat_model_names[static_cast<std::size_t>(model)];
}

constexpr char to_lower(char c) {
  return 'A' <= c && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

/// In any case; nothing for other names. "mip" is what Brush writes for antialiased scenes.
constexpr std::optional<SplatModel> splat_model_named(std::string_view name) {
  const auto is_named = [&](std::string_view known) {
    return std::ranges::equal(name, known, {}, to_lower);
  };
  if (is_named("mip")) return SplatModel::antialiased;
  const auto* found = std::ranges::find_if(splat_model_names, is_named);
  if (found == splat_model_names.end()) return std::nullopt;
  return static_cast<SplatModel>(found - splat_model_names.begin());
}

}  // namespace catgs
