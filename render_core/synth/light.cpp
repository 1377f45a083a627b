#include "render_core/synth/light.h"

#include "render_core/math/spherical_harmonics-inl.h"
#include "render_core/synth/random.h"

namespace catgs::synth {
namespace {

const glm::vec3 sun_radiance(2.25f, 1.42f, 0.66f);
const glm::vec3 sky_radiance(0.25f, 0.32f, 0.48f);
const glm::vec3 bounce_radiance(0.25f, 0.17f, 0.10f);  // from sunlit ground and walls

float filmic(float x) {  // Narkowicz 2015, "ACES filmic tone mapping curve"
  return clamp01(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f));
}

constexpr std::array<glm::vec3, 6> axes = {glm::vec3(1, 0, 0), glm::vec3(-1, 0, 0),
                                           glm::vec3(0, 1, 0), glm::vec3(0, -1, 0),
                                           glm::vec3(0, 0, 1), glm::vec3(0, 0, -1)};

std::size_t nearest_axis(const glm::vec3& n) {
  const glm::vec3 a = glm::abs(n);
  if (a.x >= a.y && a.x >= a.z) return n.x > 0.0f ? 0 : 1;
  if (a.y >= a.z) return n.y > 0.0f ? 2 : 3;
  return n.z > 0.0f ? 4 : 5;
}

float power(float x, int doublings) {  // x^(2^doublings)
  for (int i = 0; i < doublings; ++i) x *= x;
  return x;
}

/// Solves the symmetric positive definite system A X = B by Cholesky; B becomes X.
void solve(std::array<std::array<double, 16>, 16>& a, std::array<std::array<double, 3>, 16>& b) {
  for (std::size_t j = 0; j < 16; ++j) {
    for (std::size_t k = 0; k < j; ++k) a[j][j] -= a[j][k] * a[j][k];
    a[j][j] = std::sqrt(a[j][j]);
    for (std::size_t i = j + 1; i < 16; ++i) {
      for (std::size_t k = 0; k < j; ++k) a[i][j] -= a[i][k] * a[j][k];
      a[i][j] /= a[j][j];
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < 16; ++i) {
      for (std::size_t k = 0; k < i; ++k) b[i][c] -= a[i][k] * b[k][c];
      b[i][c] /= a[i][i];
    }
    for (std::size_t i = 16; i-- > 0;) {
      for (std::size_t k = i + 1; k < 16; ++k) b[i][c] -= a[k][i] * b[k][c];
      b[i][c] /= a[i][i];
    }
  }
}

/// Least-squares fit of `response(view)` over the directions from which the surface is seen. The
/// other half sphere has a small weight, towards zero, which keeps the fit tame beyond the horizon.
template <typename Response>
Lobe fit_lobe(const glm::vec3& normal, bool two_sided, const Response& response) {
  constexpr int samples = 600;
  std::array<std::array<double, 16>, 16> a{};
  std::array<std::array<double, 3>, 16> b{};
  for (int i = 0; i < samples; ++i) {  // Fibonacci sphere
    const float y = 1.0f - (static_cast<float>(i) + 0.5f) * (2.0f / samples);
    const float r = std::sqrt(1.0f - y * y);
    const SinCos turn = sin_cos_turns(static_cast<float>(i) * 0.61803399f);
    const glm::vec3 view(r * turn.cos, y, r * turn.sin);
    const bool seen = two_sided || glm::dot(view, normal) < 0.0f;
    const double weight = seen ? 1.0 : 0.05;
    const glm::vec3 value = seen ? response(view) : glm::vec3(0.0f);
    float basis[16];
    math::sh_basis<float>({view.x, view.y, view.z}, 3, basis);
    for (std::size_t j = 0; j < 16; ++j) {
      for (std::size_t k = 0; k <= j; ++k) a[j][k] += weight * basis[j] * basis[k];
      for (int c = 0; c < 3; ++c) b[j][static_cast<std::size_t>(c)] += weight * basis[j] * value[c];
    }
  }
  for (std::size_t j = 0; j < 16; ++j) a[j][j] += 0.5;
  solve(a, b);
  Lobe lobe;
  for (std::size_t j = 0; j < 16; ++j) {
    lobe[j] = {static_cast<float>(b[j][0]), static_cast<float>(b[j][1]),
               static_cast<float>(b[j][2])};
  }
  return lobe;
}

}  // namespace

glm::vec3 to_display(const glm::vec3& linear) {
  return {std::sqrt(filmic(linear.x)), std::sqrt(filmic(linear.y)), std::sqrt(filmic(linear.z))};
}

Light::Light(const glm::vec3& to_sun, std::uint64_t key) : to_sun_(to_sun), key_(key) {
  for (int g = 0; g < gloss_count; ++g) {
    for (std::size_t axis = 0; axis < axes.size(); ++axis) {
      const auto gloss = static_cast<Gloss>(g);
      lobes_[static_cast<std::size_t>(g)][axis] =
          fit_lobe(axes[axis], gloss == Gloss::leaf,
                   [&](const glm::vec3& view) { return response(gloss, axes[axis], view); });
    }
  }
}

glm::vec3 Light::shade(const glm::vec3& albedo, const glm::vec3& normal, float sun_visibility,
                       float sky_visibility, const glm::vec3& glow) const {
  const float facing = glm::dot(normal, to_sun_);
  const float upward = 0.5f - 0.5f * normal.y;
  const glm::vec3 sun = sun_radiance * (facing > 0.0f ? facing * sun_visibility : 0.0f);
  const glm::vec3 sky = sky_radiance * (sky_visibility * (0.35f + 0.65f * upward));
  const glm::vec3 bounce = bounce_radiance * (sky_visibility * (1.0f - 0.6f * upward));
  return to_display(albedo * (sun + sky + bounce) + glow);
}

glm::vec3 Light::clear_sky(const glm::vec3& d) const {
  const float height = d.y < 0.0f ? -d.y : 0.0f;
  const float toward = 0.5f + 0.5f * (d.x * to_sun_.x + d.z * to_sun_.z);  // 1 below the sun
  const glm::vec3 zenith(0.27f, 0.44f, 0.71f);
  const glm::vec3 middle =
      blend(glm::vec3(0.52f, 0.62f, 0.79f), glm::vec3(0.74f, 0.74f, 0.74f), toward);
  const glm::vec3 horizon =
      blend(glm::vec3(0.82f, 0.70f, 0.69f), glm::vec3(1.0f, 0.82f, 0.55f), toward);
  const glm::vec3 low = blend(horizon, middle, smooth_step(0.02f, 0.42f, height));
  const glm::vec3 gradient = blend(low, zenith, smooth_step(0.22f, 0.95f, height));
  const float cosine = clamp01(glm::dot(d, to_sun_));
  const float glow = 0.30f * power(cosine, 2) + 0.35f * power(cosine, 5) + 0.6f * power(cosine, 9);
  return glm::min(gradient + glm::vec3(1.0f, 0.80f, 0.48f) * glow * 0.55f, glm::vec3(1.0f));
}

glm::vec3 Light::haze(const glm::vec3& direction) const {
  const float level = std::sqrt(direction.x * direction.x + direction.z * direction.z) + 1e-6f;
  return clear_sky({direction.x / level * 0.9987f, -0.05f, direction.z / level * 0.9987f});
}

glm::vec3 Light::sky(const glm::vec3& d) const {
  glm::vec3 colour = clear_sky(d);
  const float height = -d.y;
  if (height <= 0.02f) return colour;
  // Clouds on a plane overhead: near the horizon they lie closer together and dissolve in haze.
  const float reach = 1.0f / (height + 0.18f);
  const float x = d.x * reach * 1.7f;
  const float z = d.z * reach * 2.6f;
  const float density = fractal_noise(key_, x + 11.0f, z + 5.0f, 5);
  const float ahead =
      fractal_noise(key_, x + 11.0f + 0.25f * to_sun_.x, z + 5.0f + 0.25f * to_sun_.z, 4);
  const float cover = smooth_step(0.45f, 0.60f, density) * smooth_step(0.02f, 0.16f, height);
  const float lit = clamp01(0.62f + 2.2f * (density - ahead));
  const float toward = clamp01(glm::dot(d, to_sun_));
  const glm::vec3 shade_colour =
      blend(glm::vec3(0.62f, 0.58f, 0.68f), glm::vec3(0.80f, 0.64f, 0.55f), toward);
  const glm::vec3 lit_colour =
      blend(glm::vec3(0.98f, 0.88f, 0.80f), glm::vec3(1.0f, 0.93f, 0.76f), toward);
  return blend(colour, blend(shade_colour, lit_colour, lit), 0.9f * cover);
}

/// The reflection in a mirror in a street: sky above, walls at eye level, paving below.
glm::vec3 Light::mirrored(const glm::vec3& d) const {
  const glm::vec3 walls = blend(glm::vec3(0.34f, 0.29f, 0.27f), glm::vec3(0.62f, 0.46f, 0.33f),
                                clamp01(0.5f - 0.5f * (d.x * to_sun_.x + d.z * to_sun_.z)));
  const glm::vec3 paving(0.30f, 0.28f, 0.27f);
  const float height = -d.y;
  const glm::vec3 low = blend(paving, walls, smooth_step(-0.25f, 0.05f, height));
  return blend(low, clear_sky(d), smooth_step(0.0f, 0.35f, height));
}

glm::vec3 Light::response(Gloss gloss, const glm::vec3& n, const glm::vec3& view) const {
  const glm::vec3 reflected = view - n * (2.0f * glm::dot(view, n));
  const float facing = clamp01(-glm::dot(view, n));
  const float grazing = (1.0f - facing) * (1.0f - facing);
  const float glint = clamp01(glm::dot(reflected, to_sun_));
  const glm::vec3 warm(1.0f, 0.78f, 0.45f);
  switch (gloss) {
    case Gloss::matte:
      return warm * (0.10f * power(glint, 2)) + glm::vec3(0.05f * grazing);
    case Gloss::glass:
      return mirrored(reflected) * (0.30f + 0.60f * grazing) + warm * (0.85f * power(glint, 3));
    case Gloss::paint:
      return mirrored(reflected) * (0.12f + 0.40f * grazing) + warm * (0.45f * power(glint, 3));
    case Gloss::water:
      return clear_sky(
                 {reflected.x, reflected.y < 0.0f ? reflected.y : -reflected.y, reflected.z}) *
                 (0.35f + 0.50f * grazing) +
             warm * (0.6f * power(glint, 3));
    case Gloss::asphalt:
      return mirrored(reflected) * (0.22f * grazing) + warm * (0.22f * grazing * power(glint, 2));
    case Gloss::leaf: {
      const float through = clamp01(glm::dot(view, to_sun_));
      return glm::vec3(0.34f, 0.34f, 0.06f) * (0.75f * power(through, 1)) -
             glm::vec3(0.03f, 0.03f, 0.02f);
    }
  }
  return glm::vec3(0.0f);
}

const Lobe& Light::lobe(Gloss gloss, const glm::vec3& normal) const {
  return lobes_[static_cast<std::size_t>(gloss)][nearest_axis(normal)];
}

}  // namespace catgs::synth
