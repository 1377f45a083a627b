#include <string>

#include "render_core/base/error.h"
#include "render_core/synth/scenes.h"
#include "render_core/synth/synth.h"

namespace catgs {
namespace {

constexpr std::size_t fewest_gaussians = 1'000;
constexpr std::size_t most_gaussians = 64'000'000;

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
  if (gaussians < fewest_gaussians || gaussians > most_gaussians) {
    throw InputError("procedural scene", "gaussians",
                     std::to_string(gaussians) + " is out of range", "1000 to 64000000");
  }
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

}  // namespace catgs
