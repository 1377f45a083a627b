#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "server/encode/encoder.h"

namespace catgs {

/// Makes encoders: make_encoder(), or a substitute for hardware in tests.
using EncoderFactory = std::function<std::unique_ptr<Encoder>(EncoderKind, const EncoderSettings&)>;

/// The encoders of one stream. The two used last are kept, because a camera that stops and goes
/// alternates between two picture sizes. A visitor who compares two qualities does the same. Only
/// one NVENC encoder is kept, because its driver opens few. Not thread-safe.
class StreamEncoders {
 public:
  /// Returns the encoder with these settings and opens it if needed, replacing the least recently
  /// used one. Throws what `make` throws, and then keeps the others.
  Encoder& use(EncoderKind kind, const EncoderSettings& settings, const EncoderFactory& make);
  /// Closes the encoder used last, because its state after a failure is unknown.
  void drop_last() { kept_.erase(kept_.begin()); }

  [[nodiscard]] std::size_t size() const { return kept_.size(); }

 private:
  struct Kept {
    EncoderKind kind = EncoderKind::x264;
    EncoderSettings settings;
    std::unique_ptr<Encoder> encoder;
  };
  std::vector<Kept> kept_;  // most recently used first
};

}  // namespace catgs
