#include "render_core/synth/plants.h"

#include <array>

#include <glm/geometric.hpp>

#include "render_core/synth/shapes.h"

namespace catgs::synth {
namespace {

glm::vec3 unit_vector(Random& random) {
  const float y = random.uniform(-1.0f, 1.0f);
  const float r = std::sqrt(1.0f - y * y);
  const SinCos turn = sin_cos_turns(random.uniform());
  return {r * turn.cos, y, r * turn.sin};
}

struct Clump {
  glm::vec3 centre;
  float radius;
};

constexpr int clump_count = 9;

/// One big clump and smaller ones around it, filling a crown.
std::array<Clump, clump_count> grow_crown(const glm::vec3& centre, float crown, Random& random) {
  std::array<Clump, clump_count> clumps;
  clumps[0] = {centre, crown * 0.62f};
  const float start = random.uniform();
  for (int i = 1; i < clump_count; ++i) {
    const SinCos turn = sin_cos_turns(start + static_cast<float>(i) * 0.382f);
    const float lift = random.uniform(-0.50f, 0.75f);
    const float out = crown * random.uniform(0.45f, 0.62f) * std::sqrt(1.0f - 0.7f * lift * lift);
    clumps[static_cast<std::size_t>(i)] = {
        centre + glm::vec3(out * turn.cos, -lift * crown, out * turn.sin),
        crown * random.uniform(0.36f, 0.50f)};
  }
  return clumps;
}

}  // namespace

glm::vec3 leaf_albedo(Random& random) {
  const float u = random.uniform();
  if (u < 0.07f) return {0.30f, 0.145f, 0.035f};
  if (u < 0.17f) return {0.25f, 0.20f, 0.05f};
  return blend(glm::vec3(0.085f, 0.15f, 0.035f), glm::vec3(0.17f, 0.21f, 0.05f), random.uniform());
}

void paint_tree(Painter& painter, const glm::vec3& foot, float height, float crown,
                const glm::vec3& albedo, float haze, double weight, std::uint64_t key) {
  const std::size_t count = painter.take(weight);
  if (count == 0) return;
  Random random(key);
  const glm::vec3 centre = foot + up * (height - crown);
  const std::array<Clump, clump_count> clumps = grow_crown(centre, crown, random);
  const Light& light = painter.light();

  const std::size_t wood = count >= 12 ? 3 + count / 40 : 0;
  const std::size_t core = (count - wood) / 9;
  const std::size_t leaves = count - wood - core;
  const Finish bark{.albedo = {0.095f, 0.078f, 0.065f}, .sky_visibility = 0.6f, .haze = haze};
  painter.divide(wood, [&](Painter& p) {
    paint_line(p, foot, foot + up * (height - 1.4f * crown), 0.42f, bark, 3.0, child(key, 1));
    for (std::size_t i = 1; i < 5; ++i) {
      paint_line(p, foot + up * (height - 1.5f * crown), clumps[i].centre, 0.2f, bark, 0.8,
                 child(key, 1 + i));
    }
  });
  // Dark clumps in the middle close the crown behind its leaves.
  for (std::size_t i = 0; i < core; ++i) {
    const Clump& clump = clumps[i % clump_count];
    const glm::vec3 point = clump.centre + unit_vector(random) * (0.25f * clump.radius);
    const float size = clump.radius * 0.40f;
    const float depth = clamp01(0.5f + 0.5f * glm::dot(point - centre, light.to_sun()) / crown);
    const glm::vec3 colour = light.shade(albedo * 0.55f, light.to_sun(), 0.25f * depth, 0.45f);
    painter.put({.mean = point,
                 .rotation = random_rotation(random),
                 .scale = glm::vec3(size, size * 0.8f, size * 0.7f) * random.spread(0.1f),
                 .opacity = 0.97f,
                 .colour = haze > 0.0f ? blend(colour, light.haze(point), haze) : colour});
  }
  float area = 0.0f;
  for (const Clump& clump : clumps) area += clump.radius * clump.radius;
  const float share = std::sqrt(12.566f * area / static_cast<float>(leaves + 1));
  // Only other trees and houses count: the clump's normals hold the shading by this tree.
  const float sun = painter.shadows().sun_visibility(centre + light.to_sun() * (2.3f * crown));
  float reached = 0.0f;
  std::size_t which = 0;
  for (std::size_t i = 0; i < leaves; ++i) {
    const float t = (static_cast<float>(i) + 0.5f) / static_cast<float>(leaves) * area;
    while (which + 1 < clump_count && reached + clumps[which].radius * clumps[which].radius < t) {
      reached += clumps[which].radius * clumps[which].radius;
      ++which;
    }
    const Clump& clump = clumps[which];
    const glm::vec3 out = unit_vector(random);
    const glm::vec3 point = clump.centre + out * (clump.radius * random.uniform(0.72f, 1.10f));
    const glm::vec3 from_centre = (point - centre) / crown;
    const glm::vec3 normal =
        glm::normalize(out * 0.8f + from_centre * 0.7f + glm::vec3(0, -0.15f, 0));
    const float facing = glm::dot(normal, light.to_sun());
    const float lit = sun * smooth_step(-0.35f, 0.55f, facing);
    const float open = 0.45f + 0.45f * clamp01(0.5f + 0.5f * -normal.y);
    const glm::vec3 tone = albedo * random.spread(0.34f);
    const glm::vec3 colour = light.shade(tone, light.to_sun(), 0.62f * lit, open);
    const bool fringe = random.chance(0.10f);
    const float size = share * (fringe ? 0.45f : 0.31f) * random.spread(0.40f);
    const glm::vec3 tilt = glm::normalize(normal + unit_vector(random) * 1.1f);
    const glm::vec3 side = glm::normalize(glm::cross(tilt, glm::vec3(0.36f, 0.48f, 0.8f)));
    painter.put({.mean = point,
                 .rotation = rotation_of(side, glm::cross(tilt, side)),
                 .scale = {size * 1.25f, size * 0.85f, size * 0.2f},
                 .opacity = fringe ? random.uniform(0.06f, 0.45f) : random.uniform(0.90f, 0.985f),
                 .colour = haze > 0.0f ? blend(colour, light.haze(point), haze) : colour,
                 .lobe = &light.lobe(Gloss::leaf, up),
                 .lobe_gain = (0.35f + 0.65f * sun) * (1.0f - haze)});
  }
}

void paint_blades(Painter& painter, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
                  float height, const glm::vec3& albedo, float haze, double weight,
                  std::uint64_t key) {
  const std::size_t count = painter.take(weight);
  const Light& light = painter.light();
  Random random(key);
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec2 t{random.uniform(), random.uniform()};
    const glm::vec3 foot = corner + u * t.x + v * t.y;
    const glm::vec3 lean = unit_vector(random) * 0.5f;
    const glm::vec3 along = glm::normalize(glm::vec3(lean.x, -1.0f, lean.z));
    const glm::vec3 side =
        glm::normalize(glm::cross(along, unit_vector(random) + glm::vec3(1e-3f)));
    const float length = height * random.spread(0.3f);
    const float sun = painter.shadows().sun_visibility(foot + along * length);
    const glm::vec3 colour =
        light.shade(albedo * random.spread(0.2f), light.to_sun(), 0.55f * sun, 0.8f);
    painter.put({.mean = foot + along * (0.45f * length),
                 .rotation = rotation_of(along, side),
                 .scale = {0.36f * length, 0.05f * length, 0.012f * length},
                 .opacity = random.chance(0.12f) ? random.uniform(0.06f, 0.45f)
                                                 : random.uniform(0.91f, 0.985f),
                 .colour = haze > 0.0f ? blend(colour, light.haze(foot), haze) : colour,
                 .lobe = &light.lobe(Gloss::leaf, up),
                 .lobe_gain = (0.3f + 0.7f * sun) * (1.0f - haze)});
  }
}

}  // namespace catgs::synth
