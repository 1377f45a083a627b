#include "server/session/encoder_allocator.h"

#include <algorithm>
#include <utility>

namespace catgs {

EncoderAllocator::EncoderAllocator(std::vector<EncoderChoice> best_first, const Policy& policy)
    : encoders_(std::move(best_first)), policy_(policy) {
  if (policy_.nvenc_sessions > 0) seats_->set_limit(EncoderKind::nvenc, policy_.nvenc_sessions);
}

std::optional<Codec> EncoderAllocator::best_codec(std::span<const Codec> decoders) const {
  const auto found = std::ranges::find_if(decoders, [&](Codec codec) {
    return std::ranges::count(encoders_, codec, &EncoderChoice::codec) > 0;
  });
  return found == decoders.end() ? std::nullopt : std::optional(*found);
}

bool EncoderAllocator::serves(std::span<const Codec> decoders) const {
  return best_codec(decoders).has_value();
}

std::string EncoderAllocator::offer() const {
  std::string text;
  for (const EncoderChoice& encoder : encoders_) text += (text.empty() ? "" : "; ") + encoder.text;
  return text;
}

std::optional<EncoderAllocator::Grant> EncoderAllocator::first_free(
    Codec codec, bool queue, TimePoint now, std::optional<EncoderKind> except) const {
  for (const EncoderChoice& encoder : encoders_) {
    if (encoder.codec != codec || encoder.kind == except) continue;
    if (auto seat = seats_->take(encoder.kind, now)) return Grant{encoder, std::move(seat)};
    if (queue) break;
  }
  return std::nullopt;
}

std::optional<EncoderAllocator::Grant> EncoderAllocator::grant(std::span<const Codec> decoders,
                                                               TimePoint now) const {
  const auto codec = best_codec(decoders);
  if (!codec) return std::nullopt;
  return first_free(*codec, policy_.queue_for_nvenc, now);
}

std::optional<EncoderAllocator::Grant> EncoderAllocator::renew(const Grant& had,
                                                               std::span<const Codec> decoders,
                                                               TimePoint now) const {
  if (best_codec(decoders) == had.encoder.codec) return had;
  return grant(decoders, now);
}

std::optional<EncoderAllocator::Grant> EncoderAllocator::replace_refused(
    const Grant& refused, std::span<const Codec> decoders, TimePoint now) const {
  if (refused.encoder.kind != EncoderKind::nvenc) return std::nullopt;
  seats_->refused(*refused.seat, now);
  const auto codec = best_codec(decoders);
  if (!codec) return std::nullopt;
  return first_free(*codec, false, now);
}

std::optional<EncoderAllocator::Grant> EncoderAllocator::replace_failed(
    const Grant& failed, std::span<const Codec> decoders, TimePoint now) const {
  if (failed.encoder.kind != EncoderKind::nvenc) return std::nullopt;
  const auto codec = best_codec(decoders);
  if (!codec) return std::nullopt;
  return first_free(*codec, false, now, EncoderKind::nvenc);
}

std::map<std::string, int> EncoderAllocator::in_use() const {
  std::map<std::string, int> in_use;
  for (const EncoderChoice& encoder : encoders_) in_use.emplace(encoder_name(encoder.kind), 0);
  for (const auto& [kind, taken] : seats_->taken()) in_use[std::string(encoder_name(kind))] = taken;
  return in_use;
}

}  // namespace catgs
