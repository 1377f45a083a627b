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
  // Those of another kind serve no more. Room first: a driver may open no second one.
  std::erase_if(kept_, [&](const Kept& kept) { return kept.kind != kind; });
  const std::size_t others = kind == EncoderKind::nvenc ? 0 : 1;
  if (kept_.size() > others) kept_.resize(others);
  kept_.insert(kept_.begin(), Kept{kind, settings, make(kind, settings)});
  return *kept_.front().encoder;
}

}  // namespace catgs
