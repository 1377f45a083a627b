#pragma once

#include <glm/vec3.hpp>

#include "render_core/synth/painter.h"

namespace catgs::synth {

/// How a piece of surface looks.
struct Finish {
  glm::vec3 albedo{0.5f};  // linear
  Gloss gloss = Gloss::matte;
  float gloss_gain = 1.0f;
  float sky_visibility = 1.0f;       // ambient occlusion at the piece's start …
  float sky_visibility_end = -1.0f;  // … and at the far end of its edge v; negative: the same
  glm::vec3 glow{0.0f};              // linear light of its own
  float mottle = 0.06f;              // relative variation of the albedo, metres to decimetres wide
  float haze = 0.0f;                 // share of the haze in front of it
  float opacity = 0.97f;
};

/// A parallelogram that faces cross(u, v); u and v are its whole edges, in metres. The edge
/// opposite to u may be shortened by shares of it at its start and its end: to a trapezium or a
/// triangle.
struct Patch {
  glm::vec3 corner;
  glm::vec3 u;
  glm::vec3 v;
  float cut_start = 0.0f;
  float cut_end = 0.0f;
};

/// Flat Gaussians in rows over the patch, overlapping so that it looks closed at any count.
/// `overlap` is a Gaussian's standard deviation over its share of an edge. The outermost stay
/// `inset` standard deviations inside: about 1 where another patch continues, more at a silhouette.
void paint_patch(Painter& painter, const Patch& patch, const Finish& finish, std::size_t count,
                 std::uint64_t key, float overlap = 0.60f, float inset = 0.9f);

/// The same, with the number of Gaussians for a piece of this weight.
void paint_patch(Painter& painter, const Patch& patch, const Finish& finish, double weight,
                 std::uint64_t key, float overlap = 0.60f, float inset = 0.9f);

/// Needle-like Gaussians from a to b: poles, rails, frames, lines.
void paint_line(Painter& painter, const glm::vec3& a, const glm::vec3& b, float thickness,
                const Finish& finish, double weight, std::uint64_t key);

/// The four walls (u x v facing outwards) and the top of an upright box; weight by area.
void paint_box(Painter& painter, const glm::vec3& min, const glm::vec3& max, const Finish& finish,
               double weight, std::uint64_t key);

/// An ellipsoid's skin, `radii` along the world axes.
void paint_blob(Painter& painter, const glm::vec3& centre, const glm::vec3& radii,
                const Finish& finish, double weight, std::uint64_t key);

}  // namespace catgs::synth
