#include "render_core/motion/window_gain.h"

namespace catgs {
namespace {

constexpr float weight = 0.25f;       // of a new value in a mean
constexpr float least_gain = 0.03f;   // under this, one kind of frame is as good as the other
constexpr float refused_cost = 0.3f;  // of a sub-frame that is not blended, in frames
// Groups of one kind before one of the other. A plain group costs little among windows. A window
// that does not pay costs more, and plain groups may be single frames.
constexpr int windows_in_a_row = 32, plain_in_a_row = 256;

}  // namespace

void WindowGain::add(float& mean, float value) {
  mean = mean > 0.0f ? mean + weight * (value - mean) : value;
}

void WindowGain::note_key(float ms) {
  key_ms_ = ms;
  if (plain_ms_ > 0.0f) add(key_share_, ms / plain_ms_);
}

/// Measured against the group's key frame, which sees nearly the same.
void WindowGain::note_sub(float ms) {
  if (key_ms_ > 0.0f) add(sub_share_, ms / key_ms_ * key_share_);
}

float WindowGain::expected_share() const {
  return (key_share_ + (frames_ - 1.0f) * sub_share_) / frames_;
}

bool WindowGain::begin_group(int frames, bool refused) {
  if (frames > 0) add(frames_, static_cast<float>(frames) - (refused ? refused_cost : 0.0f));
  const bool pays = expected_share() < 1.0f - least_gain;
  if (pays != windows_) {
    windows_ = pays;
    since_other_ = 0;
  }
  // A group of one frame tells nothing of sub-frames.
  const bool tries_other = ++since_other_ > (windows_ ? windows_in_a_row : plain_in_a_row) &&
                           (windows_ || frames_ > 1.8f);
  if (tries_other) since_other_ = 0;
  return windows_ != tries_other;
}

}  // namespace catgs
