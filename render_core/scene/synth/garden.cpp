#include <glm/geometric.hpp>

#include "render_core/scene/first_sight.h"
#include "render_core/scene/synth/backdrop.h"
#include "render_core/scene/synth/plants.h"
#include "render_core/scene/synth/scenes.h"
#include "render_core/scene/synth/shapes.h"

namespace catgs::synth {
namespace {

constexpr float half_m = 8.0f;

void paint_plot(Painter& p, std::uint64_t key, float x, float z, float size) {
  p.shadows().focus({at(x, 3, z), at(x + size, 0, z + size)});
  const Finish soil{
      .albedo = glm::vec3(0.10f, 0.12f, 0.045f), .sky_visibility = 0.7f, .mottle = 0.3f};
  paint_patch(p, {at(x, 0, z), {size, 0, 0}, {0, 0, size}}, soil, 0.25, child(key, 1));
  paint_blades(p, at(x, 0, z), {size, 0, 0}, {0, 0, size}, 0.11f, {0.13f, 0.21f, 0.045f}, 0.75,
               child(key, 2));
}

}  // namespace

Scene make_garden(std::size_t count, std::uint64_t seed, ThreadPool& pool) {
  const Light light(glm::normalize(glm::vec3(-0.6f, -0.55f, 0.35f)), child(seed, 1));
  Scene scene;
  scene.cloud.resize(count, max_sh_degree);
  constexpr std::size_t side = 8;
  constexpr std::size_t parts = side * side + 1;
  const std::size_t backdrop = count / 8;
  pool.parallel_for(parts, [&](std::size_t part) {
    Shadows shadows(light.to_sun());
    if (part + 1 == parts) {
      Painter painter(light, shadows, scene.cloud, count - backdrop, backdrop, 1.0);
      painter.divide(painter.take(1.0), [&](Painter& p) {
        paint_sky(p, {0, 0}, 120.0f, 0.2, child(seed, 2));
        paint_horizon(p, {0, 0}, half_m, 120.0f, {0.12f, 0.16f, 0.06f}, 0.1, child(seed, 3));
        Random random(child(seed, 4));
        for (std::uint64_t i = 0; i < 26; ++i) {
          const SinCos turn =
              sin_cos_turns((static_cast<float>(i) + 0.3f * random.uniform()) / 26.0f);
          const float r = random.uniform(10.0f, 17.0f);
          const glm::vec3 leaves = leaf_albedo(random);
          paint_tree(p, at(r * turn.cos, 0, r * turn.sin), random.uniform(5, 9),
                     random.uniform(2, 3), leaves, 0.05f, 0.03, child(seed, 10 + i));
        }
      });
      return;
    }
    const std::size_t in_plots = count - backdrop;
    const std::size_t first = in_plots * part / (parts - 1);
    const std::size_t last = in_plots * (part + 1) / (parts - 1);
    const float size = 2.0f * half_m / side;
    Painter painter(light, shadows, scene.cloud, first, last - first, 1.0);
    painter.divide(painter.take(1.0), [&](Painter& p) {
      paint_plot(p, child(seed, 100 + part), -half_m + size * static_cast<float>(part % side),
                 -half_m + size * static_cast<float>(part / side), size);
    });
  });
  scene.name = "garden";
  scene.format = "procedural";
  scene.hints.start_pose = look_at(at(0.6f, 1.1f, -3.4f), at(0, 0.5f, 0), up);
  scene.hints.near_z = 0.05f;
  scene.hints.limits = {at(-half_m, 3.0f, -half_m), at(half_m, 0.15f, half_m)};
  scene.hints.focus = at(0, 0.6f, 0);
  scene.hints.source = "procedural";
  return scene;
}

}  // namespace catgs::synth
