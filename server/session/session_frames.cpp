// A session's frames: when one is due and of what, and what becomes of it.
#include <algorithm>
#include <utility>

#include "server/session/same_view.h"
#include "server/session/session.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr int max_failures_in_a_row = 3;

}  // namespace

bool Session::view_has_changed() const {
  return !shown_ || !same_view(*shown_, track_.aim(), admission_.scene->facts.near_z);
}

std::optional<FrameCandidate> Session::next_frame() const {
  if (!streams() || rendering_ || !track_.newest() || !flow_.may_send()) return std::nullopt;
  const bool moved = view_has_changed();
  FrameCandidate frame{moved ? pace_.next_start_of_pose() : pace_.next_start(),
                       {},
                       cost_.next(),
                       cost_.key_is_next(),
                       device_};
  if (!moved) {
    // Between two poses of a moving camera a refinement would only be in the next one's way.
    const bool refines = refinements_left_ > 0 || shown_is_passing_;
    const TimePoint still = last_motion_ + policy_.still_after;
    if (idr_.wanted() && (!refines || idr_.earliest() <= still)) {
      frame.ready = std::max(frame.ready, idr_.earliest());
    } else if (refines) {
      frame.ready = std::max(frame.ready, still);
      frame.key = shown_is_passing_;
      if (!frame.key) frame.cost = cost_.refinement();
    } else {
      return std::nullopt;
    }
  }
  frame.ready = std::max(frame.ready, idr_.no_frame_before());
  frame.deadline = frame.ready + flow_.frame_interval();
  return frame;
}

FrameOrder Session::start_frame(TimePoint now) {
  pace_.frame_starts(flow_.frame_interval(), now);
  flow_.set_real_interval(pace_.real_interval());
  rendering_ = true;
  FrameOrder order;
  order.force_idr = idr_.take(now);
  order.bitrate_kbps = flow_.bitrate_kbps();
  order.real_fps = pace_.real_fps(config_.fps);
  const bool still = !order.force_idr && !view_has_changed();
  // What stays is a key frame of the pose itself: a sub-frame may lack a little at the edges of
  // tiles, and a forecast goes further than a camera that stops.
  order.ticket.refined = still && !shown_is_passing_;
  if (still) track_.aim_at_newest();
  const PoseSample& aim = track_.aim();
  shown_is_passing_ = !same_view(aim, *track_.newest(), admission_.scene->facts.near_z);
  if (order.ticket.refined)
    --refinements_left_;
  else
    refinements_left_ = config_.codec == Codec::h264 ? policy_.refine_frames : 0;
  shown_ = aim;

  order.ticket.frame_id = ++frames_started_;
  order.ticket.pose_id = aim.pose_id;
  order.ticket.pose_client_time_us = aim.client_time_us;
  order.ticket.render_pose = aim.world_from_camera;
  order.ticket.fov_y_rad = aim.fov_y_rad;
  order.ticket.size_px = config_.size_px;
  order.ticket.pose_received = pose_received_;
  order.request.camera = make_camera(aim.world_from_camera, config_.size_px,
                                     focal_from_fov_y(aim.fov_y_rad, config_.size_px.y),
                                     admission_.scene->facts.near_z);
  if (!still)
    order.request.forecast = track_.forecast(order.real_fps, SpeculationSettings{}.initial_window);
  return order;
}

void Session::on_frame(FrameResult result, TimePoint now) {
  rendering_ = false;
  if (state_ == State::closed) return;
  if (stream_outdated_) request_stream();
  if (!result.ok) {
    shown_.reset();
    idr_.missed();
    if (++failures_ >= max_failures_in_a_row)
      fail(ErrorCode::render_failed, "rendering failed: " + result.message);
    return;
  }
  failures_ = 0;
  if (result.frame.ticket.frame_id <= obsolete_frames_) return;
  last_said_ = now;
  cost_.add(result.frame.ticket);
  if (result.frame.ticket.speculated) shown_is_passing_ = true;
  flow_.sent(result.frame.ticket.frame_id, result.frame.bitstream.size(),
             result.frame.ticket.size_px, now);
  const auto dropped = host_.send(std::move(result.frame));
  for (const std::uint64_t id : dropped) flow_.lost(id);
  if (dropped.empty()) return;
  idr_.dropped(now);
  frames_dropped_ += dropped.size();
  stats_.dropped_packets += static_cast<std::uint32_t>(dropped.size());
}

void Session::on_frame_sent(const FrameTicket& ticket, std::size_t bytes) {
  ++frames_sent_;
  bytes_sent_ += bytes;
  ++second_frames_;
  second_bytes_ += bytes;
  if (!ticket.refined) ++(ticket.speculated ? stats_.sub_frames : stats_.key_frames);
}

void Session::send_statistics(TimePoint now) {
  const float seconds = std::chrono::duration<float>(now - second_start_).count();
  second_start_ = now;
  if (second_frames_ == 0) return;  // the heartbeat speaks for a still picture
  stats_.fps = static_cast<float>(second_frames_) / seconds;
  stats_.bitrate_kbps = static_cast<float>(second_bytes_) * 8e-3f / seconds;
  stats_.sessions = host_.session_count();
  stats_.target_bitrate_kbps = flow_.bitrate_kbps();
  stats_.target_fps = static_cast<int>(1s / flow_.frame_interval());
  stats_.steps_down = static_cast<std::uint32_t>(flow_.steps_down());
  stats_.queue_delay_us = static_cast<std::uint32_t>(flow_.queue_delay().count());
  stats_.rtt_us = static_cast<std::uint32_t>(flow_.credit().base_rtt().count());
  say(stats_, now);
  stats_ = {};
  second_frames_ = 0;
  second_bytes_ = 0;
}

}  // namespace catgs
