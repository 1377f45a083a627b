#include <array>

#include <glm/geometric.hpp>

#include "render_core/math/look_at.h"
#include "render_core/synth/backdrop.h"
#include "render_core/synth/plants.h"
#include "render_core/synth/scenes.h"
#include "render_core/synth/shapes.h"

namespace catgs::synth {
namespace {

// A cottage garden seen from close by: a stone table under a tree, a path that winds to it between
// flower beds, a meadow around, a hedge of trees behind. Metres; the table stands at the origin.
constexpr float half_m = 7.0f;     // of the garden's side
constexpr std::size_t plots = 14;  // of the ground, along one side
constexpr float path_half_width = 0.45f;
constexpr double backdrop_share = 0.16;

/// Middle of the path at this z.
float path_x(float z) { return 0.55f * sin_cos_turns(z * 0.11f).sin; }

/// Density relative to that at the table.
float garden_detail(const glm::vec2& position) {
  return glm::max(0.12f, 1.0f / (1.0f + glm::dot(position, position) / 6.0f));
}

bool in_bed(float x, float z) {
  const float from_path = glm::abs(x - path_x(z));
  return from_path > path_half_width + 0.08f && from_path < 1.75f && glm::abs(z) > 0.9f;
}

/// A square of ground: slabs, soil or grass, each with its plants.
void paint_plot(Painter& p, const glm::vec2& corner, float size, std::uint64_t key) {
  const glm::vec2 middle = corner + 0.5f * size;
  const double area = static_cast<double>(size) * size * garden_detail(middle);
  p.shadows().focus({at(corner.x, 0.8f, corner.y), at(corner.x + size, 0, corner.y + size)});
  const Finish soil{
      .albedo = glm::vec3(0.085f, 0.085f, 0.04f), .sky_visibility = 0.7f, .mottle = 0.3f};
  paint_patch(p, {at(corner.x, 0, corner.y), {size, 0, 0}, {0, 0, size}}, soil, 90.0 * area,
              child(key, 1), 0.65f);
  Random random(child(key, 2));
  constexpr int tufts = 26;
  for (int i = 0; i < tufts; ++i) {
    const glm::vec2 position = corner + size * glm::vec2{random.uniform(), random.uniform()};
    const std::uint64_t tuft = random.bits();
    if (glm::abs(position.x - path_x(position.y)) < path_half_width) continue;
    const double weight = 900.0 / tufts * area;
    if (in_bed(position.x, position.y)) {
      paint_flower_tuft(p, at(position.x, 0, position.y), weight, tuft);
      continue;
    }
    const float s = 0.14f * size;
    const glm::vec3 green =
        blend(glm::vec3(0.10f, 0.17f, 0.035f), glm::vec3(0.20f, 0.22f, 0.06f), random.uniform());
    paint_blades(p, at(position.x - s, 0, position.y - s), {2 * s, 0, 0}, {0, 0, 2 * s},
                 random.uniform(0.07f, 0.14f), green, 0.0f, 0.8 * weight, tuft);
  }
}

/// Irregular flagstones along the path.
void paint_path(Painter& p, double weight, std::uint64_t key) {
  p.shadows().focus({at(-2, 0.1f, -half_m), at(2, 0, half_m)});
  p.divide(p.take(weight), [&](Painter& q) {
    Random random(key);
    for (float z = -half_m; z < half_m; z += 0.46f) {
      for (const float side : {-0.5f, 0.5f}) {
        const float x = path_x(z) + side * 0.44f + random.uniform(-0.04f, 0.04f);
        const float w = random.uniform(0.34f, 0.42f), d = random.uniform(0.36f, 0.43f);
        const glm::vec3 stone =
            blend(glm::vec3(0.34f, 0.30f, 0.25f), glm::vec3(0.25f, 0.25f, 0.25f), random.uniform());
        const Finish finish{.albedo = stone, .sky_visibility = 0.85f, .mottle = 0.16f};
        const glm::vec3 corner = at(x - 0.5f * w, 0.035f, z + random.uniform(-0.03f, 0.03f));
        paint_box(q, corner, corner + glm::vec3(w, 0.05f, d), finish, garden_detail({x, z}),
                  random.bits());
      }
    }
  });
}

/// A round stone table, a bench of wood, a pot of flowers and a lantern.
void paint_furniture(Painter& p, double weight, std::uint64_t key) {
  p.shadows().focus({at(-2, 2, -2), at(2, 0, 2)});
  p.divide(p.take(weight), [&](Painter& q) {
    const Finish stone{
        .albedo = glm::vec3(0.44f, 0.41f, 0.36f), .sky_visibility = 0.9f, .mottle = 0.12f};
    paint_blob(q, at(0, 0.70f, 0), {0.55f, 0.045f, 0.55f}, stone, 6.0, child(key, 1));
    paint_blob(q, at(0, 0.36f, 0), {0.15f, 0.36f, 0.15f}, stone, 2.5, child(key, 2));
    paint_blob(q, at(0, 0.04f, 0), {0.34f, 0.06f, 0.34f}, stone, 1.5, child(key, 3));
    const Finish clay{
        .albedo = glm::vec3(0.40f, 0.19f, 0.11f), .sky_visibility = 0.85f, .mottle = 0.08f};
    paint_blob(q, at(0.08f, 0.82f, 0.05f), {0.12f, 0.11f, 0.12f}, clay, 1.8, child(key, 4));
    for (std::uint64_t i = 0; i < 14; ++i) {
      Random random(child(key, 20 + i));
      const glm::vec3 aside{random.uniform(-0.08f, 0.08f), 0.0f, random.uniform(-0.08f, 0.08f)};
      paint_flower_tuft(q, at(0.08f, 0.88f, 0.05f) + aside, 0.7, random.bits());
    }
    const Finish enamel{
        .albedo = glm::vec3(0.10f, 0.22f, 0.30f), .gloss = Gloss::paint, .sky_visibility = 0.9f};
    paint_blob(q, at(-0.24f, 0.79f, -0.12f), {0.07f, 0.055f, 0.07f}, enamel, 1.2, child(key, 5));
    const Finish wood{
        .albedo = glm::vec3(0.30f, 0.19f, 0.10f), .sky_visibility = 0.85f, .mottle = 0.2f};
    for (int plank = 0; plank < 3; ++plank) {
      const float z = 1.05f + 0.15f * static_cast<float>(plank);
      paint_box(q, at(-0.75f, 0.46f, z), at(0.75f, 0.42f, z + 0.13f), wood, 1.4,
                child(key, 6 + static_cast<std::uint64_t>(plank)));
    }
    for (const float x : {-0.62f, 0.56f}) {
      paint_box(q, at(x, 0.42f, 1.08f), at(x + 0.07f, 0, 1.45f), wood, 0.8,
                child(key, x < 0 ? 12 : 13));
    }
  });
}

void paint_backdrop(Painter& p, std::uint64_t seed) {
  paint_sky(p, {0, 0}, 150.0f, 0.20, child(seed, 2));
  paint_horizon(p, {0, 0}, half_m, 150.0f, {0.11f, 0.14f, 0.05f}, 0.06, child(seed, 3));
  Random random(child(seed, 4));
  constexpr int trees = 34;
  for (int i = 0; i < trees; ++i) {
    const SinCos turn = sin_cos_turns((static_cast<float>(i) + 0.6f * random.uniform()) / trees);
    const float r = half_m + random.uniform(1.5f, 9.0f);
    const glm::vec3 leaves = leaf_albedo(random);
    const float height = random.uniform(3.5f, 8.0f);
    const float crown = random.uniform(1.6f, 2.6f);
    paint_tree(p, at(r * turn.cos, 0, r * turn.sin), height, crown, leaves, 0.02f * r - 0.12f,
               0.72 / trees, random.bits());
  }
}

}  // namespace

Scene make_garden(std::size_t count, std::uint64_t seed, ThreadPool& pool) {
  const Light light(glm::normalize(glm::vec3(-0.62f, -0.52f, 0.42f)), child(seed, 1));
  const auto add_tree_shadow = [](Shadows& shadows) {
    shadows.add_ball(at(-2.2f, 3.0f, 2.4f), 1.5f, 0.75f);
    shadows.add_box(at(-0.5f, 0.74f, -0.5f), at(0.5f, 0.68f, 0.5f));
    shadows.add_box(at(-0.75f, 0.46f, 1.05f), at(0.75f, 0.42f, 1.48f));
  };
  const float size = 2.0f * half_m / plots;
  const auto corner_of = [&](std::size_t plot) {
    return glm::vec2(-half_m) + size * glm::vec2(plot % plots, plot / plots);
  };
  // All plots are measured first, so that Gaussians can be shared out; then they are painted in
  // parallel.
  constexpr std::size_t ground_parts = plots * plots;
  std::vector<double> sums = {0.0};
  for (std::size_t i = 0; i < ground_parts; ++i) {
    sums.push_back(sums.back() + garden_detail(corner_of(i) + 0.5f * size));
  }
  const auto backdrop = static_cast<std::size_t>(backdrop_share * static_cast<double>(count));
  const std::size_t things = count / 8;
  const std::size_t ground = count - backdrop - things;
  const auto first_of = [&](std::size_t i) {
    return i == ground_parts
               ? ground
               : static_cast<std::size_t>(sums[i] / sums.back() * static_cast<double>(ground));
  };
  Scene scene;
  scene.cloud.resize(count, max_sh_degree);
  pool.parallel_for(ground_parts + 2, [&](std::size_t part) {
    Shadows shadows(light.to_sun());
    add_tree_shadow(shadows);
    const auto paint = [&](std::size_t first, std::size_t last, const auto& content) {
      Painter painter(light, shadows, scene.cloud, first, last - first, 1.0);
      painter.divide(painter.take(1.0), content);
    };
    if (part == ground_parts) {
      paint(ground, ground + things, [&](Painter& p) {
        paint_path(p, 0.22, child(seed, 5));
        paint_furniture(p, 0.34, child(seed, 6));
        p.shadows().focus({at(-4, 6, 1), at(-1, 0, 4)});
        paint_tree(p, at(-2.2f, 0, 2.4f), 4.4f, 1.45f, {0.12f, 0.17f, 0.04f}, 0.0f, 0.36,
                   child(seed, 7));
        paint_floaters(p, at(-half_m, 2.5f, -half_m), at(half_m, 0.1f, half_m), 0.08,
                       child(seed, 8));
      });
    } else if (part == ground_parts + 1) {
      paint(ground + things, count, [&](Painter& p) { paint_backdrop(p, seed); });
    } else {
      paint(first_of(part), first_of(part + 1),
            [&](Painter& p) { paint_plot(p, corner_of(part), size, child(seed, 100 + part)); });
    }
  });
  scene.name = "garden";
  scene.format = "procedural";
  scene.hints.start_pose = look_at(at(0.75f, 1.15f, -2.7f), at(-0.1f, 0.62f, 0.1f), up);
  scene.hints.near_z = 0.05f;
  scene.hints.scale = 3.0f;
  scene.hints.limits = {at(-half_m, 3.0f, -half_m), at(half_m, 0.15f, half_m)};
  scene.hints.focus = at(0, 0.6f, 0);
  scene.hints.about.metres_per_unit = 1.0f;
  scene.hints.source = "procedural";
  return scene;
}

}  // namespace catgs::synth
