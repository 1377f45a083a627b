#include "server/encode/encoder_choices.h"

#include <algorithm>

#include <fmt/format.h>

#include "render_core/base/error.h"

namespace catgs {

std::vector<EncoderChoice> usable_encoders(EncoderKind wanted,
                                           const std::vector<EncoderProbe>& probes) {
  std::vector<EncoderChoice> choices;
  std::string unusable;
  for (const auto& probe : probes) {
    const bool admitted =
        wanted == EncoderKind::automatic || probe.kind == wanted || probe.kind == EncoderKind::jpeg;
    if (!admitted) continue;
    if (!probe.usable) {
      unusable += fmt::format("; {}: {}", probe.name, probe.reason);
      if (probe.kind == wanted)
        throw InputError("--encoder " + probe.name, {}, probe.reason, "try --encoder auto");
      continue;
    }
    // The reason of a choice also tells why better ones were not chosen.
    choices.push_back({probe.kind, probe.kind == EncoderKind::jpeg ? Codec::mjpeg : Codec::h264,
                       fmt::format("{} ({}{})", probe.name, probe.reason, unusable)});
  }
  if (choices.empty()) throw InputError("--encoder", {}, "no encoder works here" + unusable);
  return choices;
}

std::optional<EncoderChoice> best_encoder(std::span<const EncoderChoice> best_first,
                                          std::span<const Codec> decoders) {
  for (const Codec codec : decoders)
    if (const auto found = std::ranges::find(best_first, codec, &EncoderChoice::codec);
        found != best_first.end())
      return *found;
  return std::nullopt;
}

std::optional<EncoderChoice> instead_of_nvenc(std::span<const EncoderChoice> best_first,
                                              const EncoderChoice& had) {
  if (had.kind != EncoderKind::nvenc) return std::nullopt;
  const auto found = std::ranges::find_if(best_first, [&](const EncoderChoice& other) {
    return other.codec == had.codec && other.kind != EncoderKind::nvenc;
  });
  return found == best_first.end() ? std::nullopt : std::optional(*found);
}

}  // namespace catgs
