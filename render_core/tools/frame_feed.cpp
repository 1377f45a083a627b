#include "render_core/tools/frame_feed.h"

#include <cassert>

namespace catgs {

FrameFeed::FrameFeed(const RenderSetup& setup, const ViewSettings& settings)
    : setup_(setup),
      forecast_frames_(has_groups(settings.pipeline) ? settings.speculation.initial_window : 0),
      predictor_(setup.predictor) {}

FrameRequest FrameFeed::next() {
  assert(next_frame_ < setup_.poses.size());
  FrameRequest request = setup_.request(next_frame_);
  if (forecast_frames_ > 0) {
    const std::int64_t now_us = setup_.poses[next_frame_].time_us;
    const Trajectory& samples = setup_.samples;
    for (; next_sample_ < samples.size() && samples[next_sample_].time_us <= now_us;
         ++next_sample_) {
      predictor_.add(samples[next_sample_]);
    }
    request.forecast = predictor_.forecast(now_us, setup_.fps, forecast_frames_);
  }
  ++next_frame_;
  return request;
}

}  // namespace catgs
