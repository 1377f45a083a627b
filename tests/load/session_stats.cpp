#include "tests/load/session_stats.h"

#include <algorithm>
#include <utility>

namespace catgs::load {

void SessionStats::started(std::int64_t now_us) {
  connected = true;
  last_frame_us_ = -1;  // the time without a connection is no frame interval
  last_frame_id_ = 0;   // a new connection may count anew
  if (started_) return;
  started_ = true;
  start_us_ = end_us_ = now_us;
}

void SessionStats::interrupted(std::int64_t now_us) {
  if (started_ && interrupted_us_ < 0) interrupted_us_ = now_us;
}

void SessionStats::pose_sent(std::uint64_t pose_id, std::int64_t now_us) {
  ++counts.poses_sent;
  sent_[pose_id % sent_.size()] = {pose_id, now_us};
}

void SessionStats::age_until(std::int64_t now_us) {
  while (true) {
    const auto tick_us =
        start_us_ + static_cast<std::int64_t>(static_cast<double>(ticks_) * tick_us_);
    if (tick_us >= now_us) return;
    ++ticks_;
    // A picture that has not come yet is as old as the session.
    const std::int64_t age_us = tick_us - (shown_pose_us_ >= 0 ? shown_pose_us_ : start_us_);
    durations.pose_age.add(age_us);
    if (series_ != nullptr) series_->at(tick_us).pose_age.add(age_us);
  }
}

void SessionStats::frame_received(const ReceivedFrame& frame, std::int64_t now_us) {
  age_until(now_us);
  ++counts.frames;
  counts.bytes += frame.bytes;
  counts.idrs += frame.idr ? 1 : 0;
  if (frame.frame_id <= last_frame_id_) error("frame ids do not increase");
  last_frame_id_ = frame.frame_id;
  if (last_frame_us_ >= 0) durations.frame_interval.add(now_us - last_frame_us_);
  if (interrupted_us_ >= 0) durations.recovery.add(now_us - std::exchange(interrupted_us_, -1));
  if (series_ != nullptr) {
    SeriesBin& bin = series_->at(now_us);
    ++bin.frames;
    bin.bytes += frame.bytes;
    bin.pixels += frame.pixels;
    if (last_frame_us_ < 0 || !series_->same_bin(last_frame_us_, now_us)) ++bin.sessions;
  }
  last_frame_us_ = now_us;
  durations.wait.add(frame.wait_us);
  durations.render.add(frame.render_us);
  durations.encode.add(frame.encode_us);
  durations.send.add(frame.send_us);

  const SentPose& sent = sent_[frame.pose_id % sent_.size()];
  if (frame.pose_id == 0 || sent.pose_id != frame.pose_id) {
    error("a frame echoes a pose that was not sent lately");
  } else if (frame.pose_id < shown_pose_id_) {
    error("a frame echoes an older pose than the one before");
  } else if (frame.pose_id == shown_pose_id_) {
    ++counts.repeated_poses;
  } else {
    shown_pose_id_ = frame.pose_id;
    shown_pose_us_ = sent.time_us;
    durations.pose_to_frame.add(now_us - sent.time_us);
    if (series_ != nullptr) series_->at(now_us).pose_to_frame.add(now_us - sent.time_us);
  }
}

void SessionStats::error(const std::string& description) {
  constexpr std::size_t max_kinds = 32;
  ++counts.errors;
  const bool room = error_counts.size() < max_kinds || error_counts.contains(description);
  ++error_counts[room ? description : "other errors"];
}

void SessionStats::finished(std::int64_t now_us) {
  if (!started_) return;
  age_until(now_us);
  end_us_ = std::max(end_us_, now_us);
}

double SessionStats::fps() const {
  return measured_s() > 0.0 ? static_cast<double>(counts.frames) / measured_s() : 0.0;
}

double SessionStats::bitrate_kbps() const {
  return measured_s() > 0.0 ? 8e-3 * static_cast<double>(counts.bytes) / measured_s() : 0.0;
}

}  // namespace catgs::load
