#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>

#include "tests/load/histogram.h"
#include "tests/load/time_series.h"

namespace catgs::load {

/// A frame as a client sees it. Times are in microseconds.
struct ReceivedFrame {
  std::uint64_t frame_id = 0;
  std::uint64_t pose_id = 0;
  bool idr = false;
  std::uint64_t bytes = 0;
  std::uint64_t pixels = 0;
  std::uint32_t wait_us = 0, render_us = 0, encode_us = 0, send_us = 0;  // on the server
};

struct Durations {
  DurationHistogram admission;      // first hello sent -> welcome: a place, the scene in memory
  DurationHistogram pose_to_frame;  // pose sent -> first frame that echoes it received
  DurationHistogram pose_age;       // at each nominal tick: age of the pose behind the newest frame
  DurationHistogram frame_interval;  // between receptions
  DurationHistogram recovery;        // interruption -> next frame received
  DurationHistogram wait, render, encode, send;
  DurationHistogram decode;  // on this machine
};

struct Counts {
  std::uint64_t frames = 0;
  std::uint64_t repeated_poses = 0;  // frames that echo a pose again: a still picture refined
  std::uint64_t bytes = 0;
  std::uint64_t idrs = 0;
  std::uint64_t poses_sent = 0;
  std::uint64_t errors = 0;
  std::uint64_t decode_errors = 0;
  std::uint64_t frames_skipped = 0;  // not decoded: the decoder's queue was full
  std::uint64_t reconnects = 0;
  std::uint64_t leaves = 0;  // followed by another visitor
  std::uint64_t decoders_lost = 0;
};

/// The books of one session, all on the client's own clock. Pure; memory is bounded.
class SessionStats {
 public:
  /// `nominal_fps` sets the ticks at which pose age is sampled. `series`, which may be null, is
  /// shared with other sessions and outlives this one.
  explicit SessionStats(double nominal_fps, TimeSeries* series = nullptr)
      : tick_us_(1e6 / nominal_fps), series_(series) {}

  /// The session is admitted: its measured time begins (again, after a reconnection: the first
  /// call counts).
  void started(std::int64_t now_us);
  /// The connection is gone: the next frame ends a recovery.
  void interrupted(std::int64_t now_us);
  /// Whatever kept frames away is over now: a recovery begins here.
  void may_recover(std::int64_t now_us) { interrupted_us_ = started_ ? now_us : -1; }
  void pose_sent(std::uint64_t pose_id, std::int64_t now_us);
  void frame_received(const ReceivedFrame& frame, std::int64_t now_us);
  void frame_decoded(std::int64_t duration_us) { durations.decode.add(duration_us); }
  /// Something went wrong; equal descriptions are counted together, up to a bounded number of
  /// different ones.
  void error(const std::string& description);
  /// The run is over: the picture on show has aged until now.
  void finished(std::int64_t now_us);

  /// Delivered frames over measured time.
  [[nodiscard]] double fps() const;
  [[nodiscard]] double bitrate_kbps() const;
  [[nodiscard]] double measured_s() const {
    return 1e-6 * static_cast<double>(end_us_ - start_us_);
  }

  Durations durations;
  Counts counts;
  bool connected = false;  // at least once
  std::map<std::string, std::uint64_t> error_counts;

 private:
  struct SentPose {
    std::uint64_t pose_id = 0;
    std::int64_t time_us = 0;
  };
  /// Samples the age of the picture on show at every tick before `now_us`.
  void age_until(std::int64_t now_us);

  double tick_us_;
  TimeSeries* series_;
  std::array<SentPose, 2048> sent_{};  // by pose_id modulo its size: seconds of poses
  bool started_ = false;
  std::int64_t start_us_ = 0;
  std::int64_t end_us_ = 0;
  std::int64_t last_frame_us_ = -1;
  std::int64_t interrupted_us_ = -1;
  std::uint64_t last_frame_id_ = 0;
  std::uint64_t shown_pose_id_ = 0;
  std::int64_t shown_pose_us_ = -1;
  std::uint64_t ticks_ = 0;
};

}  // namespace catgs::load
