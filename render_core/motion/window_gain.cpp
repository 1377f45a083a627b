#include "render_core/motion/window_gain.h"

#include <algorithm>

namespace catgs {
namespace {

constexpr float weight = 0.25f;       // of a new value in a mean
constexpr float least_gain = 0.03f;   // under this, one kind of frame is as good as the other
constexpr float refused_cost = 0.3f;  // of a sub-frame that is not blended, in frames
// Among windows, a group without one now and then measures what they save. Windows that do not pay
// are tried for a group after so many frames, if groups would last so long.
constexpr int windows_in_a_row = 16, frames_without = 512;
constexpr float worth_a_try = 1.8f;

}  // namespace

void WindowGain::add(float& mean, float value) {
  mean = mean > 0.0f ? mean + weight * (value - mean) : value;
}

void WindowGain::measure(float& share, float now) {
  constexpr float most_change = 1.2f;
  add(share, std::clamp(now, share / most_change, share * most_change));
}

/// Only a frame just before tells what the same view costs without a window.
void WindowGain::note_key(float ms) {
  if (plain_ms_ > 0.0f) measure(key_share_, ms / plain_ms_);
  key_ms_ = ms;
  plain_ms_ = 0.0f;
}

/// The first one is measured against its key frame, which sees nearly the same.
void WindowGain::note_sub(float ms) {
  if (key_ms_ > 0.0f) measure(sub_share_, ms / key_ms_ * key_share_);
  key_ms_ = 0.0f;
}

bool WindowGain::pays(float frames) const {
  return key_share_ + (frames - 1.0f) * sub_share_ < (1.0f - least_gain) * frames;
}

bool WindowGain::begin_group(const Group& last) {
  if (last.frames > 0) {
    const float frames = static_cast<float>(last.frames) - (last.refused ? refused_cost : 0.0f);
    add(last.window ? window_frames_ : planned_frames_, frames);
    wait_frames_ -= last.frames;
  }
  if (!windows_) {
    if (wait_frames_ > 0 || last.frames == 0) return false;
    wait_frames_ = frames_without;
    window_frames_ = planned_frames_;
    groups_ = 0;
    windows_ = pays(planned_frames_);
    return windows_ || planned_frames_ > worth_a_try;
  }
  windows_ = pays(window_frames_);
  if (!windows_) wait_frames_ = frames_without;
  return windows_ && ++groups_ % windows_in_a_row != 0;
}

}  // namespace catgs
