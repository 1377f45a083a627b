#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "render_core/synth/exact_math.h"

namespace catgs::synth {

/// How a surface reflects light besides scattering it evenly.
enum class Gloss {
  matte,    // a trace of sheen at grazing angles: plaster, stone
  glass,    // mirrors the sky, more at grazing angles
  paint,    // lacquer: car bodies, metal roofs
  water,    // mirrors the sky, strongly
  asphalt,  // shines against the low sun
  leaf,     // lets the sun through: brighter when seen against it
};
inline constexpr int gloss_count = 6;

/// The view-dependent part of a colour: spherical-harmonics coefficients of degree 0…3, in the
/// order and with the signs of the original 3DGS. They are added to those of the Gaussian.
using Lobe = std::array<glm::vec3, 16>;

/// A low sun, a sky around it, and the colours that they make. Radiances are linear; `shade` and
/// `sky` return display-referred values in [0, 1]. World axes, y down.
class Light {
 public:
  Light(const glm::vec3& to_sun, std::uint64_t key);

  [[nodiscard]] const glm::vec3& to_sun() const { return to_sun_; }

  /// Display colour of a matte surface with this linear albedo. The visibilities in [0, 1] say how
  /// much of the sun and of the sky it sees; `glow` is linear light that it emits.
  [[nodiscard]] glm::vec3 shade(const glm::vec3& albedo, const glm::vec3& normal,
                                float sun_visibility, float sky_visibility,
                                const glm::vec3& glow = glm::vec3(0.0f)) const;

  /// Colour of the clouded sky in a unit direction; below the horizon, its haze.
  [[nodiscard]] glm::vec3 sky(const glm::vec3& direction) const;

  /// The haze that far things fade into.
  [[nodiscard]] glm::vec3 haze(const glm::vec3& direction) const;

  /// View dependence of a gloss on a surface that faces `normal` (the nearest axis is taken).
  [[nodiscard]] const Lobe& lobe(Gloss gloss, const glm::vec3& normal) const;

 private:
  [[nodiscard]] glm::vec3 clear_sky(const glm::vec3& direction) const;
  [[nodiscard]] glm::vec3 mirrored(const glm::vec3& direction) const;
  [[nodiscard]] glm::vec3 response(Gloss gloss, const glm::vec3& normal,
                                   const glm::vec3& view) const;

  glm::vec3 to_sun_;
  std::uint64_t key_;
  std::array<std::array<Lobe, 6>, gloss_count> lobes_;
};

/// Maps linear radiance to display values: a filmic curve, then gamma 2.
glm::vec3 to_display(const glm::vec3& linear);

}  // namespace catgs::synth
