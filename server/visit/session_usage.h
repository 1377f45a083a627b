#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "render_core/frame/renderer.h"
#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// The durations in /api/sessions. The last two span several stages.
enum class SessionTime {
  queue_wait,
  render,
  encode,
  send,
  pose_to_frame,     // pose received to frame handed to the socket
  motion_to_photon,  // pose sampled to frame shown, on the client's clock
};
inline constexpr std::size_t session_time_count = 6;
inline constexpr std::array<std::string_view, session_time_count> session_time_names = {
    "queue_wait", "render", "encode", "send", "pose_to_frame", "motion_to_photon"};

struct Percentiles {
  double p50 = 0;
  double p95 = 0;
  double p99 = 0;
};

/// The last 128 values of a duration. Not thread-safe.
class RecentTimes {
 public:
  void add(double seconds);
  /// Returns nothing before the first value.
  [[nodiscard]] std::optional<Percentiles> percentiles() const;

 private:
  static constexpr std::size_t capacity = 128;
  std::vector<double> values_;
  std::size_t next_ = 0;
};

/// Measures one session's use of the machine and its frame times. A session has one frame under way
/// at a time. Pure; not thread-safe.
class SessionUsage {
 public:
  void frame_started(TimePoint now);
  /// `device_seconds` is the GPU time of the frame; 0 on the CPU core. A still counts as `frames`
  /// frames in motion, by its pixels.
  void frame_ended(const FrameTicket& ticket, double device_seconds, TimePoint now,
                   double frames = 1.0);
  void frame_sent(const FrameTicket& ticket, TimePoint now);
  void frame_shown(double motion_to_photon_s);

  /// Returns the time since the last call during which a frame was under way.
  double take_busy_seconds(TimePoint now);
  /// Charges the processor time of all threads that worked for the session since the last call,
  /// `interval_s` ago.
  void charge_cpu(double seconds, double interval_s);

  [[nodiscard]] double cpu_seconds() const { return cpu_seconds_; }
  [[nodiscard]] double gpu_seconds() const { return gpu_seconds_; }
  /// Cost of one rendered frame, the mean over the last dozens; nothing until some are measured.
  struct FrameCost {
    double cpu_seconds = 0;
    double gpu_seconds = 0;
  };
  [[nodiscard]] std::optional<FrameCost> frame_cost() const;
  /// Scales the expected frame cost by `factor`.
  void scale_frame_cost(double factor);
  /// The recent share of a GPU's time; nothing until some frames are measured.
  [[nodiscard]] std::optional<double> gpu_load() const;
  /// The recent share of time that its encoder works, and the encode time of a frame.
  [[nodiscard]] double encoder_load() const { return encoder_load_; }
  [[nodiscard]] double encode_seconds() const { return encode_seconds_; }
  [[nodiscard]] const RecentTimes& times(SessionTime time) const {
    return times_[static_cast<std::size_t>(time)];
  }

 private:
  void add(SessionTime time, TimePoint from, TimePoint to);

  std::optional<TimePoint> under_way_since_;
  double busy_seconds_ = 0;
  double cpu_seconds_ = 0;
  double gpu_seconds_ = 0;
  // Since the last charge_cpu().
  double rendered_ = 0;
  double rendered_gpu_seconds_ = 0;
  double encoding_seconds_ = 0;
  double frames_measured_ = 0;
  FrameCost cost_;
  double gpu_load_ = 0;
  double encoder_load_ = 0;
  double encode_seconds_ = 0;  // per frame, the mean over the last dozen
  std::array<RecentTimes, session_time_count> times_;
};

/// Divides processor time in proportion to busy time. Helpers of a frame run on threads of a shared
/// pool, so only the process as a whole can be measured.
std::vector<double> share_out(double seconds, const std::vector<double>& busy_seconds);

/// The processor time of this process so far, all threads.
double process_cpu_seconds();

}  // namespace catgs
