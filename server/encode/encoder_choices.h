#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/encode/encoder.h"

namespace catgs {

/// An encoder that the start-up probe found usable.
struct EncoderChoice {
  EncoderKind kind = EncoderKind::x264;
  Codec codec = Codec::h264;
  std::string text;  // name and reason, for people
};

/// The usable encoders that `--encoder` admits, best first. A named encoder still leaves JPEG for
/// clients without a video decoder. Throws InputError if none is left.
std::vector<EncoderChoice> usable_encoders(EncoderKind wanted,
                                           const std::vector<EncoderProbe>& probes);

/// Returns the best encoder for the client's first codec that this server can make; nothing: there
/// is none.
std::optional<EncoderChoice> best_encoder(std::span<const EncoderChoice> best_first,
                                          std::span<const Codec> decoders);

/// Returns a replacement of the same codec for NVENC that failed or cannot be opened, as its driver
/// opens only a few. Nothing: `had` is not NVENC, or no other encoder makes its codec.
std::optional<EncoderChoice> instead_of_nvenc(std::span<const EncoderChoice> best_first,
                                              const EncoderChoice& had);

}  // namespace catgs
