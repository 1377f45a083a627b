#include "server/flow/quality_ladder.h"

#include <algorithm>
#include <array>

namespace catgs {
namespace {

using namespace std::chrono_literals;

// Bits per pixel of a rendered scene in motion. The gap between both keeps a link that barely
// sustains a rung from oscillating.
constexpr double starving_bits_per_pixel = 0.025;
constexpr double rich_bits_per_pixel = 0.04;
// Pacing a decoder takes effect at once. The rung changes only where pacing would cost much.
constexpr double starving_decoder_share = 0.7;

constexpr auto want_before_falling = 1s;
constexpr std::chrono::milliseconds least_patience = 3s;
constexpr std::chrono::milliseconds most_patience = 60s;
constexpr auto rest_holds = 2s;
constexpr auto proof = 10s;  // a rung that held this long counts as proved

constexpr std::array<double, 2> scales = {0.75, 0.5};
constexpr std::array<double, 2> fps_shares = {0.5, 0.25};
constexpr double least_pixels = 320.0 * 180.0;
constexpr double least_fps = 10.0;

}  // namespace

QualityLadder::QualityLadder(glm::ivec2 size_px, int fps)
    : top_pixels_per_s_(static_cast<double>(size_px.x) * size_px.y * fps),
      rungs_{{1.0, 1.0}},
      patience_(least_patience) {
  const double pixels = static_cast<double>(size_px.x) * size_px.y;
  for (const double scale : scales)
    if (pixels * scale * scale >= least_pixels) rungs_.push_back({scale, 1.0});
  const double smallest = rungs_.back().scale;
  for (const double share : fps_shares)
    if (fps * share >= least_fps) rungs_.push_back({smallest, share});
}

double QualityLadder::pixels_per_s(std::size_t rung) const {
  const Rung& r = rungs_[rung];
  return top_pixels_per_s_ * r.scale * r.scale * r.fps_share;
}

bool QualityLadder::starves(const Supply& supply) const {
  const double pixels = pixels_per_s(current_);
  return supply.pixels_per_s < starving_decoder_share * pixels ||
         supply.bits_per_s < starving_bits_per_pixel * pixels;
}

bool QualityLadder::could_rise(const Supply& supply) const {
  if (current_ == 0) return false;
  const double pixels = pixels_per_s(current_ - 1);
  return supply.pixels_per_s >= pixels &&
         (supply.bits_unused || supply.bits_per_s >= rich_bits_per_pixel * pixels);
}

void QualityLadder::step_to(std::size_t rung, TimePoint now) {
  const bool up = rung < current_;
  if (up) {
    risen_at_ = now;
  } else if (risen_at_) {
    patience_ =
        within(risen_at_, proof, now) ? std::min(2 * patience_, most_patience) : least_patience;
  }
  current_ = rung;
  starving_since_.reset();
  rich_since_.reset();
}

bool QualityLadder::update(const Supply& supply, TimePoint now) {
  starving_since_ = held_since(starving_since_, starves(supply), now);
  rich_since_ = held_since(rich_since_, could_rise(supply), now);
  const bool falls =
      current_ + 1 < rungs_.size() && held_for(starving_since_, want_before_falling, now);
  // Not where the better rung has failed lately.
  const bool at_once = patience_ == least_patience && within(rested_at_, rest_holds, now);
  const bool rises = held_for(rich_since_, at_once ? 0ms : patience_, now);
  if (!falls && !rises) return false;
  step_to(falls ? current_ + 1 : current_ - 1, now);
  return true;
}

}  // namespace catgs
