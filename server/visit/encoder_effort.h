#pragma once

#include <chrono>
#include <cstddef>
#include <iterator>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "server/base/clock.h"
#include "server/encode/encoder.h"

namespace catgs {

/// Preset and thread count of a software encoder.
struct EncoderEffort {
  int preset = 2;   // index of effort_presets
  int threads = 1;  // one slice of the picture per thread

  bool operator==(const EncoderEffort&) const = default;
};

/// The presets of libx264, fastest first, with the processor time of one frame of a rendered scene.
/// Presets slower than medium only pay off with look-ahead, which costs frames of delay.
/// Measured on a walk through a rendered city (1280x720, 30 fps, 1.5 Mbit/s), from ultrafast,
/// superfast, veryfast, faster, fast to medium:
/// - processor time: 5.1 / 9.3 / 16.4 / 25.2 / 40.1 / 47.1 ms;
/// - quality: 36.7 / 42.7 / 42.4 / 43.0 / 43.0 / 43.2 dB.
/// Measured on heads, a drone and a walk in three scenes (1920x1080, 60 fps, 8 Mbit/s), with
/// ultrafast, ultrafast-subpel and superfast:
/// - processor time: 6.0 / 8.1 / 9.9 ms;
/// - quality: 41.0 / 46.1 / 47.0 dB.
struct EffortPreset {
  std::string_view name;
  double cost;
};
inline constexpr EffortPreset effort_presets[] = {
    {"ultrafast", 1.0}, {"ultrafast-subpel", 1.4}, {"superfast", 1.9}};

/// Chooses the effort of all software encoders from the measured headroom. Each change reopens a
/// stream with an IDR. At most half of the sessions change at once, and then none for a second.
/// - Threads: with fewer sessions than processors, large pictures are cut into two slices that are
///   encoded in parallel. One stream at a time is recut, and only when no preset has to change.
/// - Newcomer: it starts with the best preset that leaves three quarters of the processors free.
///   Its cost is assumed to equal the others' cost. The margin is wide, because more clients may
///   follow and an overload costs all of them frames. A better preset can come later.
/// - Faster preset under load: the processors were 60 % busy for a second and encoding is a good
///   part of that. Frames that come together wait for each other long before all processors are
///   busy. The sessions with the most expensive encoders change first, until the expected load is
///   50 %.
/// - Faster preset for one session: its encoder alone takes most of the frame interval. A preset
///   does not change where rendering is the bottleneck, as worse pictures would gain little.
/// - Better preset: 60 % of the processors were free for five seconds and stay free with its cost.
///   It may take at most 40 % of the frame interval. When it is taken back within half a minute,
///   the next attempt waits twice as long, up to two minutes.
/// Pure; not thread-safe.
class EffortControl {
 public:
  struct Range {
    int lowest = 0;
    int highest = std::size(effort_presets) - 1;
    int threads = 0;  // of each encoder; 0: by sessions and processors
  };
  /// A session that encodes in software.
  struct Session {
    EncoderEffort effort;
    double cpus = 0;               // kept busy by its encoder
    double share_of_interval = 0;  // encode time over frame interval
    glm::ivec2 size_px{0};
  };
  struct Change {
    std::size_t session = 0;
    EncoderEffort effort;
  };

  EffortControl(double cpus, Range presets) : cpus_(cpus), presets_(presets) {}

  /// Seconds of processor time a second that the server may use, above 0.
  void set_cpus(double cpus) { cpus_ = cpus; }
  /// The effort of a newcomer. `sessions` counts it, and sessions that encode nothing yet.
  [[nodiscard]] EncoderEffort initial(int sessions, glm::ivec2 size_px) const;
  /// Call it at least twice a second. `busy` is this process's share of the processors' time.
  /// `admitted` counts all sessions, including those at rest or hidden.
  std::vector<Change> update(double busy, int admitted, std::span<const Session> sessions,
                             TimePoint now);

 private:
  [[nodiscard]] int threads_for(int sessions, glm::ivec2 size_px) const;
  void note_costs(double busy, std::span<const Session> sessions);
  [[nodiscard]] std::optional<Change> with_other_threads(int admitted,
                                                         std::span<const Session> sessions) const;
  [[nodiscard]] std::vector<Change> faster(double busy, int admitted,
                                           std::span<const Session> sessions, TimePoint now) const;
  [[nodiscard]] std::optional<Change> slower(double busy, std::span<const Session> sessions) const;

  static constexpr std::chrono::seconds least_patience{5};

  double cpus_;
  const Range presets_;
  double busy_ = 0;            // this and the next two: at the last update()
  double cpus_per_pixel_ = 0;  // mean of a session, at the fastest preset
  int measured_ = 0;           // sessions
  std::optional<TimePoint> busy_since_;
  std::optional<TimePoint> calm_since_;
  std::optional<TimePoint> changed_;
  std::optional<TimePoint> slowed_;  // when a preset was last made slower
  std::chrono::seconds patience_ = least_patience;
};

void apply(const EncoderEffort& effort, EncoderSettings& settings);

}  // namespace catgs
