#include "render_core/motion/speculation_costs.h"

#include <algorithm>

namespace catgs {
namespace {

constexpr int mean_over = 8;     // samples
constexpr int few = 4;           // fewer samples say nothing yet
constexpr double margin = 1.02;  // costs vary as much without a reason
// Costs follow the scene in view, so an exact frame is measured again after this many frames.
constexpr int exact_every = 128;

}  // namespace

void SpeculationCosts::Mean::add(double sample) {
  samples = std::min(samples + 1, mean_over);
  value += (sample - value) / samples;
}

void SpeculationCosts::note(FrameKind kind, int window, double cost) {
  if (resting_ > 0) --resting_;
  ++since_exact_;
  if (kind == FrameKind::key) {
    close_group();
    if (window == 0) {
      exact_.add(cost);
      since_exact_ = 0;
      return;
    }
    group_ = {cost, 1, window};
  } else {
    group_.cost += cost;
    ++group_.frames;
  }
  if (group_.frames > group_.window) close_group();
}

void SpeculationCosts::close_group() {
  if (group_.frames == 0) return;
  grouped_.add(group_.cost / group_.frames);
  group_ = {};
  if (grouped_.samples >= few && exact_.samples > 0 && grouped_.value > margin * exact_.value) {
    resting_ = rest_;
    rest_ = std::min(2 * rest_, most_rest);
    grouped_ = {};  // the next try is in another view
  } else if (since_exact_ >= exact_every || exact_.samples == 0) {
    resting_ = 1;
  } else if (grouped_.samples >= 2 * few) {
    rest_ = least_rest;
  }
}

}  // namespace catgs
