#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/session/encoder_seats.h"

namespace catgs {

/// An encoder that the start-up probe found usable.
struct EncoderChoice {
  EncoderKind kind = EncoderKind::x264;
  Codec codec = Codec::h264;
  std::string text;  // name and reason, for people
};

/// Which session gets which encoder. NVENC may be short of sessions: then the next encoder of the
/// same codec serves, or newcomers wait for one, as the operator says. Without another one of that
/// codec they wait in any case: a worse codec is no way out. Session thread only.
class EncoderAllocator {
 public:
  struct Policy {
    int nvenc_sessions = 0;  // that the driver allows; 0: until it refuses one
    bool queue_for_nvenc = false;
  };
  struct Grant {
    EncoderChoice encoder;
    std::shared_ptr<const EncoderSeats::Seat> seat;
  };

  /// `best_first` is not empty.
  EncoderAllocator(std::vector<EncoderChoice> best_first, const Policy& policy);

  /// There is an encoder for one of these.
  [[nodiscard]] bool serves(std::span<const Codec> decoders) const;
  /// All encoders, for people.
  [[nodiscard]] std::string offer() const;

  /// For a newcomer with these decoders, best first. Nothing: it waits until one is given back.
  [[nodiscard]] std::optional<Grant> grant(std::span<const Codec> decoders, TimePoint now) const;
  /// For a client that is back, perhaps with other decoders: what it has, as long as that is of its
  /// best codec.
  [[nodiscard]] std::optional<Grant> renew(const Grant& had, std::span<const Codec> decoders,
                                           TimePoint now) const;
  /// Its encoder could not be opened. Nothing: that is no matter of seats, or nothing is left.
  [[nodiscard]] std::optional<Grant> replace_refused(const Grant& refused,
                                                     std::span<const Codec> decoders,
                                                     TimePoint now) const;
  /// Its encoder was open and failed, which says nothing about how many may be open: this session
  /// does without NVENC, newcomers get it. Nothing: it was not NVENC, or nothing else is left.
  [[nodiscard]] std::optional<Grant> replace_failed(const Grant& failed,
                                                    std::span<const Codec> decoders,
                                                    TimePoint now) const;

  /// Encoders in use, by libavcodec's name.
  [[nodiscard]] std::map<std::string, int> in_use() const;

 private:
  [[nodiscard]] std::optional<Codec> best_codec(std::span<const Codec> decoders) const;
  [[nodiscard]] std::optional<Grant> first_free(Codec codec, bool queue, TimePoint now,
                                                std::optional<EncoderKind> except = {}) const;

  const std::vector<EncoderChoice> encoders_;
  const Policy policy_;
  const std::shared_ptr<EncoderSeats> seats_ = std::make_shared<EncoderSeats>();
};

}  // namespace catgs
