#include "server/schedule/stream_encoders.h"

#include <algorithm>
#include <utility>

namespace catgs {

Encoder& StreamEncoders::use(EncoderKind kind, const EncoderSettings& settings,
                             const EncoderFactory& make) {
  const auto it = std::ranges::find_if(
      kept_, [&](const Kept& kept) { return kept.kind == kind && kept.settings == settings; });
  if (it != kept_.end()) {
    std::rotate(kept_.begin(), it, it + 1);
    return *kept_.front().encoder;
  }
  // Encoders of another kind are of no more use. Free the old one first, as a driver may not open a
  // second.
  std::erase_if(kept_, [&](const Kept& kept) { return kept.kind != kind; });
  const std::size_t others = kind == EncoderKind::nvenc ? 0 : 1;
  if (kept_.size() > others) kept_.resize(others);
  kept_.insert(kept_.begin(), Kept{kind, settings, make(kind, settings)});
  return *kept_.front().encoder;
}

}  // namespace catgs
