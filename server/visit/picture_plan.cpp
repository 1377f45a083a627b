#include "server/visit/picture_plan.h"

#include <algorithm>
#include <cmath>

#include "server/flow/frame_size.h"

namespace catgs {
namespace {

// Less effort for a still saves nothing: 54 kB of libx264's ultrafast show what 37 kB of superfast
// do.
constexpr int least_still_preset = 2;
static_assert(effort_presets[least_still_preset].name == "superfast");

/// The size of a picture whose halves have even sides.
glm::ivec2 with_even_halves(glm::ivec2 size_px) { return size_px - glm::ivec2(size_px.x % 4, 0); }

}  // namespace

FlowRequest request_within(const VisitPolicy& policy, const Settings& settings,
                           glm::ivec2 viewport_px) {
  const int fps = settings.max_fps > 0 ? settings.max_fps : policy.default_fps;
  const int kbps =
      settings.max_bitrate_kbps > 0 ? settings.max_bitrate_kbps : policy.default_bitrate_kbps;
  const glm::ivec2 requested_px = settings.size_px.x > 0 ? settings.size_px : viewport_px;
  return {frame_size(requested_px, policy.max_pixels), std::min(fps, policy.max_fps),
          std::min(kbps, policy.max_bitrate_kbps), settings.fixed_quality, policy.quality_ladder};
}

glm::ivec2 still_size_within(const VisitPolicy& policy, const Settings& settings,
                             glm::ivec2 viewport_px) {
  const glm::ivec2 moving_px = request_within(policy, settings, viewport_px).size_px;
  if (settings.fixed_quality || settings.still_size_px.x == 0) return moving_px;
  const glm::ivec2 still_px = frame_size(settings.still_size_px, policy.max_pixels);
  return still_px.x * still_px.y > moving_px.x * moving_px.y ? still_px : moving_px;
}

void PicturePlan::begin(const Hello& hello, const EncoderEffort& effort, double pixel_share) {
  viewport_px_ = hello.viewport_px;
  settings_ = hello.settings;
  effort_ = effort;
  pixel_share_ = pixel_share;
  update();
}

void PicturePlan::request(const Settings& settings, TimePoint now) {
  if (settings == settings_) return;
  settings_ = settings;
  settings_wait_ = true;
  follow_settings(now);
}

void PicturePlan::on_tick(TimePoint now) {
  follow_settings(now);
  if (flow_.update(now)) update();
}

void PicturePlan::use_effort(const EncoderEffort& effort) {
  effort_ = effort;
  apply(effort_, moving_);
}

void PicturePlan::use_pixel_share(double share) {
  pixel_share_ = share;
  update();
}

EncoderSettings PicturePlan::still() const {
  EncoderSettings still = moving_;
  if (still_size_px() == moving_.size_px) return still;
  EncoderEffort effort = effort_;
  effort.preset = std::max(effort.preset, least_still_preset);
  effort.threads = 1;  // one slice has the better picture, and a still has the time
  apply(effort, still);
  still.size_px = still_size_px();
  still.fps = std::min(still.fps, still_fps);  // sizes the VBV that its first picture finds full
  return still;
}

void PicturePlan::follow_settings(TimePoint now) {
  if (!settings_wait_ || within(settings_followed_, policy_.settings_gap, now)) return;
  settings_wait_ = false;
  settings_followed_ = now;
  larger_stills_ = true;
  update();
}

void PicturePlan::update() {
  FlowRequest request = request_within(policy_, settings_, viewport_px_);
  request.size_px = scaled_size(request.size_px, std::sqrt(pixel_share_));
  flow_.set_request(request);
  moving_.size_px = scaled_size(request.size_px, flow_.ladder().rung().scale);
  moving_.fps = request.fps;
  moving_.bitrate_kbps = request.bitrate_kbps;
  moving_.aq_strength = policy_.x264_aq;
  apply(effort_, moving_);
  still_size_px_ = still_size_within(policy_, settings_, viewport_px_);
  stereo_ = settings_.stereo;
  if (!stereo_) return;
  moving_.size_px = with_even_halves(moving_.size_px);
  still_size_px_ = with_even_halves(still_size_px_);
}

}  // namespace catgs
