#include <array>

#include <glm/geometric.hpp>

#include "render_core/synth/plants.h"

namespace catgs::synth {
namespace {

struct Kind {
  glm::vec3 petal;
  glm::vec3 heart;
  float height;   // metres
  float blossom;  // radius, metres
  int petals;
};

constexpr std::array<Kind, 6> kinds = {
    Kind{{0.80f, 0.78f, 0.72f}, {0.75f, 0.50f, 0.05f}, 0.30f, 0.032f, 11},  // daisy
    Kind{{0.62f, 0.05f, 0.03f}, {0.03f, 0.02f, 0.02f}, 0.38f, 0.042f, 5},   // poppy
    Kind{{0.13f, 0.15f, 0.55f}, {0.10f, 0.08f, 0.35f}, 0.34f, 0.026f, 9},   // cornflower
    Kind{{0.75f, 0.50f, 0.05f}, {0.45f, 0.22f, 0.03f}, 0.26f, 0.034f, 8},   // marigold
    Kind{{0.62f, 0.24f, 0.42f}, {0.70f, 0.58f, 0.15f}, 0.42f, 0.040f, 8},   // cosmos
    Kind{{0.34f, 0.20f, 0.52f}, {0.26f, 0.14f, 0.40f}, 0.36f, 0.018f, 6}};  // lavender

glm::vec3 tilted(Random& random, float spread) {
  const SinCos turn = sin_cos_turns(random.uniform());
  const float out = spread * std::sqrt(random.uniform());
  return glm::normalize(glm::vec3(out * turn.cos, -1.0f, out * turn.sin));
}

struct Sun {
  float visibility;
  const Lobe* lobe;
};

Splat leaf_like(const Light& light, const Sun& sun, const glm::vec3& middle, const glm::vec3& along,
                const glm::vec3& scale, const glm::vec3& albedo, Random& random) {
  const glm::vec3 side = glm::normalize(glm::cross(along, glm::vec3(0.37f, 0.48f, 0.79f)));
  return {.mean = middle,
          .rotation = rotation_of(along, side),
          .scale = scale,
          .opacity =
              random.chance(0.08f) ? random.uniform(0.08f, 0.45f) : random.uniform(0.92f, 0.985f),
          .colour = light.shade(albedo * random.spread(0.15f), light.to_sun(),
                                0.62f * sun.visibility, 0.8f),
          .lobe = sun.lobe,
          .lobe_gain = 0.35f + 0.65f * sun.visibility};
}

/// Petals around a heart; the blossom faces `axis`.
void paint_blossom(Painter& p, const Kind& kind, const Sun& sun, const glm::vec3& centre,
                   const glm::vec3& axis, std::size_t count, Random& random) {
  const Light& light = p.light();
  const glm::vec3 side = glm::normalize(glm::cross(axis, glm::vec3(0.37f, 0.48f, 0.79f)));
  const glm::vec3 other = glm::cross(axis, side);
  const std::size_t heart = 1 + count / 12;
  const float r = kind.blossom * random.spread(0.18f);
  const glm::vec3 tone = kind.petal * random.spread(0.14f);
  for (std::size_t i = 0; i < count; ++i) {
    if (i < heart) {
      const glm::vec3 position = centre + axis * (0.12f * r);
      p.put(leaf_like(light, sun, position, side, glm::vec3(0.2f * r, 0.2f * r, 0.08f * r),
                      kind.heart, random));
      continue;
    }
    const auto petal = static_cast<int>(i - heart) % kind.petals;
    const auto ring = static_cast<float>((i - heart) / static_cast<std::size_t>(kind.petals));
    const SinCos turn =
        sin_cos_turns((static_cast<float>(petal) + 0.5f * ring) / static_cast<float>(kind.petals));
    const glm::vec3 out = glm::normalize(side * turn.cos + other * turn.sin +
                                         axis * (0.15f + 0.2f * random.uniform()));
    const float reach = (0.55f + 0.12f * random.normal()) * r;
    p.put({.mean = centre + out * reach,
           .rotation = rotation_of(out, glm::normalize(glm::cross(axis, out))),
           .scale = {0.26f * r, 2.0f * r / static_cast<float>(kind.petals), 0.02f * r},
           .opacity = random.uniform(0.92f, 0.985f),
           .colour = light.shade(tone * random.spread(0.08f), light.to_sun(),
                                 0.68f * sun.visibility, 0.85f),
           .lobe = sun.lobe,
           .lobe_gain = 0.4f * (0.35f + 0.65f * sun.visibility)});
  }
}

}  // namespace

void paint_flower_tuft(Painter& painter, const glm::vec3& foot, double weight, std::uint64_t key) {
  const std::size_t count = painter.take(weight);
  if (count == 0) return;
  Random random(key);
  // Plants of a kind grow together: a slow noise chooses.
  const float choice =
      value_noise(17, foot.x * 0.9f + 40.0f, foot.z * 0.9f + 40.0f) + random.uniform(-0.13f, 0.13f);
  const auto which = static_cast<std::size_t>(clamp01((choice - 0.15f) / 0.7f) * 5.99f);
  const Kind& kind = kinds[which];
  const Light& light = painter.light();
  const Sun sun{painter.shadows().sun_visibility(foot + up * kind.height),
                &light.lobe(Gloss::leaf, up)};
  const glm::vec3 green =
      blend(glm::vec3(0.07f, 0.13f, 0.03f), glm::vec3(0.14f, 0.19f, 0.06f), random.uniform());
  const std::size_t blossoms = 1 + count / 34;
  const std::size_t per_blossom = count * 5 / (12 * blossoms);
  const std::size_t leaves = count - per_blossom * blossoms;
  for (std::size_t i = 0; i < leaves; ++i) {
    const bool stem = i < leaves / 5;
    const glm::vec3 along = tilted(random, stem ? 0.25f : 1.3f);
    const float length = kind.height * (stem ? 1.0f : 0.42f) * random.spread(0.25f);
    const float start = stem ? 0.0f : random.uniform(0.0f, 0.55f) * kind.height;
    const glm::vec3 aside{random.uniform(-0.05f, 0.05f), 0.0f, random.uniform(-0.05f, 0.05f)};
    const glm::vec3 base = foot + up * start + aside;
    const float width = stem ? 0.004f : 0.011f;
    painter.put(leaf_like(light, sun, base + along * (0.45f * length), along,
                          {0.34f * length, width, 0.25f * width}, green, random));
  }
  for (std::size_t b = 0; b < blossoms; ++b) {
    const glm::vec3 lean = tilted(random, 0.35f);
    const float reach = kind.height * random.uniform(0.8f, 1.15f);
    const glm::vec3 aside{random.uniform(-0.06f, 0.06f), 0.0f, random.uniform(-0.06f, 0.06f)};
    const glm::vec3 centre = foot + lean * reach + aside;
    paint_blossom(painter, kind, sun, centre, tilted(random, 0.9f), per_blossom, random);
  }
}

}  // namespace catgs::synth
