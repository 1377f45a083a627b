#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "server/encode/encoder.h"

namespace catgs {

/// Makes encoders: make_encoder(), or what stands in for hardware that is not there.
using EncoderFactory = std::function<std::unique_ptr<Encoder>(EncoderKind, const EncoderSettings&)>;

/// The encoders of one stream. A camera that stops and goes takes turns between two picture sizes,
/// and so does a visitor who tries one quality after the other: the two used last are kept, so that
/// neither opens one each time. Of NVENC only one: a driver opens few. Not thread-safe.
class StreamEncoders {
 public:
  /// The encoder with these settings, opened where it is not there; the one that was not used for
  /// longest goes for it. Throws what `make` throws, and keeps the others then.
  Encoder& use(EncoderKind kind, const EncoderSettings& settings, const EncoderFactory& make);
  /// Ends the one used last: it failed, and what it would make next nobody knows.
  void drop_last() { kept_.erase(kept_.begin()); }

  [[nodiscard]] std::size_t size() const { return kept_.size(); }

 private:
  struct Kept {
    EncoderKind kind = EncoderKind::x264;
    EncoderSettings settings;
    std::unique_ptr<Encoder> encoder;
  };
  std::vector<Kept> kept_;  // the one used last in front
};

}  // namespace catgs
