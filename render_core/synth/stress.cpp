#include <array>

#include <glm/geometric.hpp>

#include "render_core/math/look_at.h"
#include "render_core/synth/backdrop.h"
#include "render_core/synth/scenes.h"
#include "render_core/synth/shapes.h"

namespace catgs::synth {
namespace {

constexpr float room_m = 6.0f;  // half the side of the room that everything stands in

glm::vec3 random_point(Random& random, float half) {
  return {random.uniform(-half, half), -random.uniform(0.1f, 4.0f), random.uniform(-half, half)};
}

glm::vec3 random_colour(Random& random) {
  return {random.uniform(0.1f, 0.9f), random.uniform(0.1f, 0.9f), random.uniform(0.1f, 0.9f)};
}

/// `count` Gaussians made by `make(random, i)`.
template <typename Make>
void paint_each(Painter& painter, double weight, std::uint64_t key, const Make& make) {
  const std::size_t count = painter.take(weight);
  Random random(key);
  for (std::size_t i = 0; i < count; ++i) painter.put(make(random, i));
}

/// Ordinary content for meaningful pictures: floor, pillars, coloured balls.
void paint_room(Painter& painter, double weight, std::uint64_t key) {
  painter.divide(painter.take(weight), [&](Painter& p) {
    p.shadows().focus({at(-room_m, 5, -room_m), at(room_m, 0, room_m)});
    const Finish floor{
        .albedo = glm::vec3(0.42f, 0.38f, 0.33f), .gloss = Gloss::paint, .mottle = 0.2f};
    paint_patch(p, {at(-room_m, 0, -room_m), {2 * room_m, 0, 0}, {0, 0, 2 * room_m}}, floor, 4.0,
                child(key, 1));
    Random random(key);
    for (std::uint64_t i = 0; i < 24; ++i) {
      glm::vec3 foot = random_point(random, room_m - 1.0f) * glm::vec3(1, 0, 1);
      if (foot.z < -1.5f) foot.z += room_m;  // not before the start pose's eye
      const float r = random.uniform(0.15f, 0.45f);
      const Finish finish{.albedo = random_colour(random) * 0.6f,
                          .gloss = i % 2 == 0 ? Gloss::paint : Gloss::matte};
      if (i % 3 == 0) {
        const float h = random.uniform(0.6f, 3.0f);
        paint_box(p, foot + glm::vec3(-r, -h, -r), foot + glm::vec3(r, 0, r), finish, 0.35,
                  child(key, 10 + i));
      } else {
        paint_blob(p, foot + glm::vec3(0, -r, 0), glm::vec3(r), finish, 0.25, child(key, 10 + i));
      }
    }
  });
}

/// Alpha and order: faint, coincident, layered.
void paint_hard_to_blend(Painter& painter, std::uint64_t seed) {
  // Just above the smallest alpha that counts.
  paint_each(painter, 0.26, child(seed, 6), [](Random& r, std::size_t) {
    return Splat{.mean = random_point(r, room_m),
                 .rotation = random_rotation(r),
                 .scale = glm::vec3(0.2f, 0.1f, 0.02f) * r.spread(0.5f),
                 .opacity = r.uniform(1.01f, 3.0f) / 255.0f,
                 .colour = random_colour(r)};
  });
  // Coincident: equal depths to the bit, in crowds of 64.
  paint_each(painter, 0.17, child(seed, 7), [seed](Random& r, std::size_t i) {
    Random crowd(child(seed, 0x10000 + i / 64));
    const glm::vec3 position = random_point(crowd, room_m - 1.0f);
    return Splat{.mean = position,
                 .rotation = random_rotation(r),
                 .scale = glm::vec3(0.10f, 0.06f, 0.01f) * r.spread(0.3f),
                 .opacity = r.uniform(0.1f, 0.99f),
                 .colour = random_colour(r)};
  });
  // A wall of thousands of thin layers: long lists that never become opaque.
  paint_each(painter, 0.17, child(seed, 8), [](Random& r, std::size_t) {
    return Splat{
        .mean = glm::vec3{r.uniform(1.0f, 3.0f), -r.uniform(0.2f, 2.2f), r.uniform(-1.0f, 1.0f)},
        .rotation = random_rotation(r),
        .scale = glm::vec3(0.25f, 0.2f, 0.05f),
        .opacity = r.uniform(0.005f, 0.02f),
        .colour = random_colour(r)};
  });
}

/// Shape and colour: thin, tiny, far, out of range.
void paint_hard_to_project(Painter& painter, std::uint64_t seed) {
  // Needles: one axis up to 10^4 times another.
  paint_each(painter, 0.16, child(seed, 5), [](Random& r, std::size_t) {
    const float length = 0.15f * r.spread(0.8f);
    return Splat{.mean = random_point(r, room_m),
                 .rotation = random_rotation(r),
                 .scale = {length, length * r.uniform(1e-4f, 1e-2f), length * 1e-4f},
                 .opacity = r.uniform(0.4f, 0.99f),
                 .colour = random_colour(r)};
  });
  // Far smaller than a pixel, and far away.
  paint_each(painter, 0.18, child(seed, 10), [](Random& r, std::size_t i) {
    const bool distant = i % 4 == 0;
    return Splat{.mean = distant ? random_point(r, room_m) * 5.5f : random_point(r, room_m),
                 .rotation = random_rotation(r),
                 .scale = glm::vec3(1e-4f, 1e-5f, 1e-6f) * r.spread(1.0f),
                 .opacity = r.uniform(0.5f, 0.999f),
                 .colour = random_colour(r)};
  });
  // View dependence far outside [0, 1].
  Lobe lobe;
  paint_each(painter, 0.06, child(seed, 11), [&lobe](Random& r, std::size_t) {
    for (glm::vec3& c : lobe) c = {r.normal() * 1.5f, r.normal() * 1.5f, r.normal() * 1.5f};
    return Splat{.mean = random_point(r, room_m),
                 .rotation = random_rotation(r),
                 .scale = glm::vec3(0.05f, 0.04f, 0.01f) * r.spread(0.4f),
                 .opacity = r.uniform(0.3f, 0.99f),
                 .colour = random_colour(r),
                 .lobe = &lobe};
  });
}

/// A few Gaussians that cover the whole picture are enough, however large the scene is. More would
/// hide everything else.
void paint_covers(Painter& painter, double weight, std::uint64_t seed) {
  // Huge and faint: they touch every tile of every picture, from inside too.
  paint_each(painter, weight, child(seed, 4), [](Random& r, std::size_t) {
    return Splat{
        .mean = random_point(r, room_m),
        .rotation = random_rotation(r),
        .scale = glm::vec3{r.uniform(4.0f, 30.0f), r.uniform(1.0f, 8.0f), r.uniform(0.5f, 4.0f)},
        .opacity = r.uniform(0.006f, 0.03f),
        .colour = random_colour(r)};
  });
  // Across the near plane of the start pose, before, in and behind the eye.
  paint_each(painter, weight, child(seed, 9), [](Random& r, std::size_t) {
    return Splat{
        .mean = at(0, 1.6f, -5.0f) +
                glm::vec3{r.uniform(-0.5f, 0.5f), r.uniform(-0.5f, 0.5f), r.uniform(-2.0f, 0.6f)},
        .rotation = random_rotation(r),
        .scale = glm::vec3(r.uniform(0.02f, 0.5f), 0.03f, 0.01f),
        .opacity = r.uniform(0.02f, 0.3f),
        .colour = random_colour(r)};
  });
}

}  // namespace

Scene make_stress(std::size_t count, std::uint64_t seed, ThreadPool& pool) {
  const Light light(glm::normalize(glm::vec3(-0.5f, -0.7f, -0.5f)), child(seed, 1));
  Scene scene;
  scene.cloud.resize(count, max_sh_degree);
  constexpr std::size_t parts = 16;  // of the extremes, each with its own numbers
  const std::size_t ordinary = count * 7 / 10;
  const auto first_of = [&](std::size_t part) {
    return ordinary + (count - ordinary) * part / parts;
  };
  pool.parallel_for(parts + 1, [&](std::size_t part) {
    Shadows shadows(light.to_sun());
    const std::size_t first = part == parts ? 0 : first_of(part);
    const std::size_t last = part == parts ? ordinary : first_of(part + 1);
    Painter painter(light, shadows, scene.cloud, first, last - first, 1.0);
    painter.divide(painter.take(1.0), [&](Painter& p) {
      if (part == parts) {
        paint_sky(p, {0, 0}, 40.0f, 0.05, child(seed, 2));
        paint_room(p, 0.95, child(seed, 3));
      } else {
        const std::uint64_t key = child(seed, 100 + part);
        paint_covers(p, 1.2 / static_cast<double>(last - first), key);
        paint_hard_to_blend(p, key);
        paint_hard_to_project(p, key);
      }
    });
  });
  scene.name = "stress";
  scene.format = "procedural";
  scene.hints.start_pose = look_at(at(0, 1.6f, -5.0f), at(0, 1.2f, 0), up);
  scene.hints.near_z = 0.2f;
  scene.hints.scale = 5.0f;
  scene.hints.limits = {at(-room_m, 5.0f, -room_m), at(room_m, 0.2f, room_m)};
  scene.hints.focus = at(0, 1.2f, 0);
  scene.hints.about.metres_per_unit = 1.0f;
  scene.hints.source = "procedural";
  return scene;
}

}  // namespace catgs::synth
