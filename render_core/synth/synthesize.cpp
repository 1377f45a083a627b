#include <string>

#include "render_core/base/error.h"
#include "render_core/synth/scenes.h"
#include "render_core/synth/synth.h"

namespace catgs {
namespace {

constexpr std::size_t fewest_gaussians = 1'000;
constexpr std::size_t most_gaussians = 64'000'000;
constexpr std::size_t most_streamed = std::size_t{1} << 34;

void check_count(std::size_t gaussians, std::size_t most) {
  if (gaussians < fewest_gaussians || gaussians > most)
    throw InputError("procedural scene", "gaussians",
                     std::to_string(gaussians) + " is out of range",
                     std::to_string(fewest_gaussians) + " to " + std::to_string(most));
}

}  // namespace

SynthKind parse_synth_kind(std::string_view name) {
  if (name == "city") return SynthKind::city;
  if (name == "garden") return SynthKind::garden;
  if (name == "stress") return SynthKind::stress;
  throw InputError("procedural scene", name, "is not one of them", "city, garden, stress");
}

Scene synthesize(SynthKind kind, std::size_t gaussians, std::uint64_t seed) {
  ThreadPool pool;
  return synthesize(kind, gaussians, seed, pool);
}

Scene synthesize(SynthKind kind, std::size_t gaussians, std::uint64_t seed, ThreadPool& pool) {
  check_count(gaussians, most_gaussians);
  switch (kind) {
    case SynthKind::garden:
      return synth::make_garden(gaussians, seed, pool);
    case SynthKind::stress:
      return synth::make_stress(gaussians, seed, pool);
    case SynthKind::city:
      break;
  }
  return synth::make_city(gaussians, seed, pool);
}

SceneHints synthesize_parts(SynthKind kind, std::size_t gaussians, std::uint64_t seed,
                            ThreadPool& pool,
                            const std::function<void(const GaussianCloud&)>& take) {
  if (kind == SynthKind::city) {
    check_count(gaussians, most_streamed);
    return synth::stream_city(gaussians, seed, pool, take);
  }
  const Scene scene = synthesize(kind, gaussians, seed, pool);
  take(scene.cloud);
  return scene.hints;
}

}  // namespace catgs
