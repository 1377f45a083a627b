#include "render_core/synth/shapes.h"

#include <array>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace catgs::synth {
namespace {

/// Colour of a point of a surface, in the light that reaches it.
glm::vec3 lit_colour(const Painter& painter, const Shadows& shadows, const Finish& finish,
                     const glm::vec3& point, const glm::vec3& normal, float grain, float t) {
  const Light& light = painter.light();
  const float facing = glm::dot(normal, light.to_sun());
  // Queried slightly off the surface, so that it does not shade itself.
  const float sun = facing > 0.0f ? shadows.sun_visibility(point + normal * 0.15f) : 0.0f;
  const float sky = finish.sky_visibility_end < 0.0f
                        ? finish.sky_visibility
                        : blend(finish.sky_visibility, finish.sky_visibility_end, t);
  return light.shade(finish.albedo * grain, normal, sun, sky, finish.glow);
}

glm::vec3 hazed(const Painter& painter, const glm::vec3& colour, const glm::vec3& point,
                float haze) {
  if (haze <= 0.0f) return colour;
  return blend(colour, painter.light().haze(point), haze);
}

float solid_opacity(Random& random, float opacity) {
  const float u = random.uniform();
  return opacity * (1.0f - 0.05f * u * u);
}

/// Centres of `count` Gaussians over an edge of length 1. The outermost stay `inset` standard
/// deviations inside, so that edges are neither frayed nor open.
struct Spacing {
  float first;
  float step;
};

Spacing space_out(std::size_t count, float overlap, float inset) {
  const float margin = inset * overlap;  // in steps
  const float step = 1.0f / (static_cast<float>(count) - 1.0f + 2.0f * margin);
  return {margin * step, step};
}

}  // namespace

void paint_patch(Painter& painter, const Patch& patch, const Finish& finish, double weight,
                 std::uint64_t key, float overlap, float inset) {
  paint_patch(painter, patch, finish, painter.take(weight), key, overlap, inset);
}

void paint_patch(Painter& painter, const Patch& patch, const Finish& finish, std::size_t count,
                 std::uint64_t key, float overlap, float inset) {
  if (count == 0) return;
  const float width = glm::length(patch.u);
  const float height = glm::length(patch.v);
  const glm::vec3 u = patch.u / width;
  const glm::vec3 across = glm::cross(u, patch.v);
  const glm::vec3 normal = across / glm::length(across);
  const glm::quat rotation = rotation_of(u, glm::cross(normal, u));
  const Lobe& lobe = painter.light().lobe(finish.gloss, normal);
  const Shadows& shadows = painter.shadows();

  const auto n = static_cast<float>(count);
  const auto rows = static_cast<std::size_t>(
      glm::clamp(std::floor(std::sqrt(n * height / width) + 0.5f), 1.0f, n));
  const Spacing down = space_out(rows, overlap, inset);
  const float step_v = height * down.step;
  Random random(key);
  for (std::size_t row = 0; row < rows; ++row) {
    const std::size_t columns = (row + 1) * count / rows - row * count / rows;
    const Spacing across_row = space_out(columns, overlap, inset);
    const float middle = down.first + down.step * static_cast<float>(row);
    const float step_u =
        width * (1.0f - (patch.cut_start + patch.cut_end) * middle) * across_row.step;
    const float thickness = 0.08f * glm::min(step_u, step_v) * overlap / 0.56f;
    for (std::size_t column = 0; column < columns; ++column) {
      const float jitter_u = columns > 1 ? 0.16f * (random.uniform() - 0.5f) : 0.0f;
      const float jitter_v = rows > 1 ? 0.16f * (random.uniform() - 0.5f) : 0.0f;
      const float along =
          across_row.first + across_row.step * (static_cast<float>(column) + jitter_u);
      const float t = middle + down.step * jitter_v;
      const float s = blend(patch.cut_start * t, 1.0f - patch.cut_end * t, along);
      const glm::vec3 point = patch.corner + patch.u * s + patch.v * t;
      // One pattern for a whole wall, wherever its pieces begin.
      const float grain = 1.0f + finish.mottle * (2.0f * value_noise(1, (point.x + point.z) * 0.7f,
                                                                     (point.y + point.z) * 0.7f) -
                                                  1.0f + 0.35f * random.normal());
      const float size = overlap * random.spread(0.10f);
      const glm::vec3 colour = lit_colour(painter, shadows, finish, point, normal, grain, t);
      painter.put({.mean = point,
                   .rotation = rotation,
                   .scale = {step_u * size, step_v * size, thickness * random.spread(0.25f)},
                   .opacity = solid_opacity(random, finish.opacity),
                   .colour = hazed(painter, colour, point, finish.haze),
                   .lobe = &lobe,
                   .lobe_gain = finish.gloss_gain * (1.0f - finish.haze)});
    }
  }
}

void paint_line(Painter& painter, const glm::vec3& a, const glm::vec3& b, float thickness,
                const Finish& finish, double weight, std::uint64_t key) {
  const std::size_t count = painter.take(weight);
  if (count == 0) return;
  const glm::vec3 along = b - a;
  const float length = glm::length(along);
  const glm::vec3 u = along / length;
  const glm::vec3 helper = glm::abs(u.y) < 0.9f ? glm::vec3(0, -1, 0) : glm::vec3(-1, 0, 0);
  const glm::vec3 side = glm::normalize(glm::cross(u, helper));
  const glm::quat rotation = rotation_of(u, side);
  // A line has no single normal; this takes that of its upper or sunny side.
  const glm::vec3 normal =
      glm::normalize(painter.light().to_sun() - u * glm::dot(u, painter.light().to_sun()) +
                     glm::vec3(1e-3f, 0, 0));
  const Lobe& lobe = painter.light().lobe(finish.gloss, normal);
  Random random(key);
  const Spacing spacing = space_out(count, 0.46f, 1.6f);
  for (std::size_t i = 0; i < count; ++i) {
    const float t = spacing.first + spacing.step * static_cast<float>(i);
    const glm::vec3 point = a + along * t;
    const glm::vec3 colour = lit_colour(painter, painter.shadows(), finish, point, normal, 1.0f, t);
    painter.put({.mean = point,
                 .rotation = rotation,
                 .scale = {length * spacing.step * 0.46f, thickness * 0.4f, thickness * 0.4f},
                 .opacity = solid_opacity(random, finish.opacity),
                 .colour = hazed(painter, colour, point, finish.haze),
                 .lobe = &lobe,
                 .lobe_gain = finish.gloss_gain});
  }
}

void paint_box(Painter& painter, const glm::vec3& min, const glm::vec3& max, const Finish& finish,
               double weight, std::uint64_t key) {
  painter.divide(painter.take(weight), [&](Painter& p) {
    const glm::vec3 size = max - min;
    const glm::vec3 x(size.x, 0, 0), y(0, size.y, 0), z(0, 0, size.z);
    // y points down: the top is at min.y. In each pair the edges are ordered so that cross(u, v)
    // points outwards.
    const std::array<Patch, 5> faces = {Patch{min, x, z},       // up (-y)
                                        Patch{min, y, x},       // -z
                                        Patch{min + z, x, y},   // +z
                                        Patch{min, z, y},       // -x
                                        Patch{min + x, y, z}};  // +x
    for (std::size_t f = 0; f < faces.size(); ++f) {
      const double area = glm::length(faces[f].u) * glm::length(faces[f].v);
      paint_patch(p, faces[f], finish, area, child(key, f), 0.56f, 1.4f);
    }
  });
}

void paint_blob(Painter& painter, const glm::vec3& centre, const glm::vec3& radii,
                const Finish& finish, double weight, std::uint64_t key) {
  const std::size_t count = painter.take(weight);
  if (count == 0) return;
  Random random(key);
  const float n = static_cast<float>(count);
  const float start = random.uniform();
  for (std::size_t i = 0; i < count; ++i) {
    const float y = 1.0f - (static_cast<float>(i) + 0.5f) * 2.0f / n;
    const float r = std::sqrt(1.0f - y * y);
    const SinCos turn = sin_cos_turns(start + static_cast<float>(i) * 0.61803399f);
    const glm::vec3 d(r * turn.cos, y, r * turn.sin);
    const glm::vec3 normal = glm::normalize(d / radii);
    const glm::vec3 helper = glm::abs(normal.y) < 0.9f ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0);
    const glm::vec3 side = glm::normalize(glm::cross(normal, helper));
    const glm::vec3 point = centre + d * radii;
    // The area of the sphere divided by n, as the edge of a square.
    const float mean_radius = (radii.x + radii.y + radii.z) / 3.0f;
    const float size = mean_radius * std::sqrt(12.566f / n) * 0.6f * random.spread(0.12f);
    const float cap = mean_radius * 0.7f;  // do not outgrow a small ball of few Gaussians
    const float flat = glm::min(size, cap);
    painter.put({.mean = point - normal * (0.3f * flat),
                 .rotation = rotation_of(side, glm::cross(normal, side)),
                 .scale = {flat, flat, flat * 0.12f},
                 .opacity = solid_opacity(random, finish.opacity),
                 .colour = hazed(painter,
                                 lit_colour(painter, painter.shadows(), finish, point, normal,
                                            1.0f + finish.mottle * random.normal(), 0.0f),
                                 point, finish.haze),
                 .lobe = &painter.light().lobe(finish.gloss, normal),
                 .lobe_gain = finish.gloss_gain});
  }
}

}  // namespace catgs::synth
