#pragma once

#include <chrono>
#include <cstddef>
#include <iterator>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "server/encode/encoder.h"
#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// How hard an encoder in software tries, and with how many threads.
struct EncoderEffort {
  int preset = 2;   // index of effort_presets
  int threads = 1;  // a slice of the picture each

  bool operator==(const EncoderEffort&) const = default;
};

/// Of libx264, the fastest first, with the processor time that a frame of a rendered scene takes.
/// Slower ones are not worth theirs without looking ahead, which costs frames of delay: a walk
/// through a rendered city at 1280x720 and 1.5 Mbit/s, 30 fps, took 5.1 / 9.3 / 16.4 / 25.2 / 40.1
/// / 47.1 ms with ultrafast, superfast, veryfast, faster, fast and medium, at 36.7 / 42.7 / 42.4
/// / 43.0 / 43.0 / 43.2 dB. A recorded head there at 1920x1080 and 14 Mbit/s, 60 fps: 14 / 20 / 26
/// ms with ultrafast, ultrafast-subpel and superfast, at 39.9 / 43.8 / 44.2 dB, a calmer one
/// at 47.6 / 50.6 / 50.4.
struct EffortPreset {
  std::string_view name;
  double cost;
};
inline constexpr EffortPreset effort_presets[] = {
    {"ultrafast", 1.0}, {"ultrafast-subpel", 1.4}, {"superfast", 1.9}};

/// Chooses the effort of all software encoders by the headroom that is measured. Each change opens
/// a stream anew, with an IDR: at most half of the sessions at once, and then none for a second.
/// - Threads: where sessions are fewer than processors, pictures are cut into as many slices, which
///   shortens the wait for each; rounded up, as frames of different sessions rarely coincide. One
///   stream at a time is cut anew, when nothing more urgent is to be changed.
/// - A newcomer begins with the best preset that leaves three quarters of the processors free, if
///   it costs what the others do: more may follow, and a bad start costs them all frames, while a
///   better preset can come later.
/// - The faster preset where processors were busy for a second (60 %: frames that come together
///   wait for each other long before all are) and encoding is a good part of that, for as many
///   sessions as bring them to 50 %, those whose encoders cost the most; or where an encoder by
///   itself takes most of the time between frames. Where rendering holds frames up, a worse picture
///   would gain next to nothing.
/// - The better one again where 60 % of the processors were free for five seconds and will be with
///   its cost, and where it takes at most 40 % of the time between frames. When it has to be taken
///   back within half a minute the next try waits twice as long, two minutes at most.
/// Pure; not thread-safe.
class EffortControl {
 public:
  struct Range {
    int lowest = 0;
    int highest = std::size(effort_presets) - 1;
  };
  /// A session that encodes in software.
  struct Session {
    EncoderEffort effort;
    double cpus = 0;               // that its encoder keeps busy
    double share_of_interval = 0;  // encoding a frame, over the time between frames
    glm::ivec2 size_px{0};
  };
  struct Change {
    std::size_t session = 0;
    EncoderEffort effort;
  };

  EffortControl(int cpus, Range presets) : cpus_(cpus), presets_(presets) {}

  /// Of a newcomer who makes it so many sessions, with those that encode nothing yet.
  [[nodiscard]] EncoderEffort initial(int sessions, glm::ivec2 size_px) const;
  /// At least twice a second. `busy`: share of the processors' time that this process takes;
  /// `admitted`: sessions, with those that stand still or are hidden.
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

  const int cpus_;
  const Range presets_;
  double busy_ = 0;            // at the last update(), as the next two
  double cpus_per_pixel_ = 0;  // of a session, with the fastest preset
  int measured_ = 0;           // sessions
  TimePoint busy_since_{};     // epoch: they are not
  TimePoint calm_since_{};
  TimePoint changed_{};
  TimePoint slowed_{};  // when a preset was last made slower
  std::chrono::seconds patience_ = least_patience;
};

void apply(const EncoderEffort& effort, EncoderSettings& settings);

}  // namespace catgs
