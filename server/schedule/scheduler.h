#pragma once

#include <algorithm>
#include <map>
#include <optional>
#include <unordered_map>

#include "server/base/clock.h"

namespace catgs {

/// A frame that a session could start.
struct FrameCandidate {
  TimePoint ready;              // not before (its nominal rate)
  TimePoint deadline;           // when its nominal rate says that the frame is due
  Clock::duration cost{};       // predicted from measurements
  std::optional<int> device{};  // the device that renders it, if devices have numbers

  [[nodiscard]] TimePoint latest_start() const { return deadline - cost; }
  bool operator==(const FrameCandidate&) const = default;
};

/// Chooses the next frame by earliest deadline first. The deadline is the latest start that still
/// finishes in time, from the measured costs of the session's frames. Each frame advances its
/// session's deadline from the moment it started. Under overload the sessions therefore take turns:
/// all rates fall and no session starves.
///
/// A device takes no more than its share of the slots, so that late frames of an overloaded device
/// leave slots to others.
///
/// A source is asked for its next frame only when its own state changed. A change costs O(log n)
/// for n sources. Not thread-safe.
///
/// `Source` has `std::optional<FrameCandidate> next_frame()`, which depends on its state alone.
template <typename Source>
class FrameScheduler {
 public:
  struct Turn {
    Source& source;
    FrameCandidate frame;
    TimePoint ready;  // the time from which the frame could have started
  };

  /// `devices` is the number of devices that candidates name. With none or one, it has all slots.
  explicit FrameScheduler(int slots, int devices = 1) : devices_named_(devices) {
    set_slots(slots);
  }
  FrameScheduler(const FrameScheduler&) = delete;
  FrameScheduler& operator=(const FrameScheduler&) = delete;

  /// Fewer slots stop no frame that runs.
  void set_slots(int slots) {
    slots_ = slots;
    slots_of_device_ = devices_named_ > 1 ? (slots + devices_named_ - 1) / devices_named_ : slots;
  }
  [[nodiscard]] bool has_free_slot() const { return running_ < slots_; }
  [[nodiscard]] int running() const { return running_; }

  /// The source's next frame may have changed.
  void changed(Source& source, TimePoint now) {
    const auto frame = source.next_frame();
    const auto known = offers_.find(&source);
    if (known == offers_.end()) {
      if (frame) put_in_line(source, *frame, std::max(now, frame->ready), now);
    } else if (frame != known->second.frame) {
      const TimePoint ready = known->second.ready;
      withdraw(source);
      if (frame) put_in_line(source, *frame, std::min(ready, std::max(now, frame->ready)), now);
    }
  }
  /// The source has no frame to start any more.
  void withdraw(Source& source) {
    const auto known = offers_.find(&source);
    if (known == offers_.end()) return;
    known->second.line->erase(known->second.place);
    offers_.erase(known);
  }

  /// Takes the frame to start now and counts it as running. None: no frame is ready, or no slot is
  /// free.
  std::optional<Turn> take(TimePoint now) {
    while (!later_.empty() && later_.begin()->first <= now) line_up(*later_.begin()->second, now);
    while (Source* const source = has_free_slot() ? first_in_line() : nullptr) {
      const Offer offer = offers_.at(source);
      if (source->next_frame() != offer.frame) {  // a change that was not reported
        changed(*source, now);
        continue;
      }
      withdraw(*source);
      Device& device = devices_[offer.frame.device];
      ++running_;
      ++device.frames;
      return Turn{*source, offer.frame, std::min(offer.ready, now)};
    }
    return std::nullopt;
  }
  /// `frame` is the one of its Turn.
  void frame_ended(const FrameCandidate& frame) {
    Device& device = devices_[frame.device];
    --running_;
    --device.frames;
  }

  /// The time at which the next waiting source becomes ready.
  [[nodiscard]] std::optional<TimePoint> next_ready() const {
    return later_.empty() ? std::nullopt : std::optional(later_.begin()->first);
  }

 private:
  using Line = std::multimap<TimePoint, Source*>;
  struct Offer {
    FrameCandidate frame;
    TimePoint ready;
    Line* line;
    typename Line::iterator place;
  };
  struct Device {
    int frames = 0;
    Line waiting;  // ready, by their latest start
  };

  void put_in_line(Source& source, const FrameCandidate& frame, TimePoint ready, TimePoint now) {
    Device& device = devices_[frame.device];
    const bool later = frame.ready > now;
    Line& line = later ? later_ : device.waiting;
    const auto place = line.emplace(later ? frame.ready : frame.latest_start(), &source);
    offers_.emplace(&source, Offer{frame, ready, &line, place});
  }
  void line_up(Source& source, TimePoint now) {
    const Offer offer = offers_.at(&source);
    withdraw(source);
    put_in_line(source, offer.frame, offer.ready, now);
  }
  Source* first_in_line() {
    const typename Line::value_type* first = nullptr;
    for (const auto& [number, device] : devices_) {
      if (device.frames >= slots_of_device_ || device.waiting.empty()) continue;
      const auto& candidate = *device.waiting.begin();
      if (!first || candidate.first < first->first) first = &candidate;
    }
    return first ? first->second : nullptr;
  }

  const int devices_named_;
  int slots_ = 0;
  int slots_of_device_ = 0;
  int running_ = 0;
  std::unordered_map<const Source*, Offer> offers_;
  Line later_;  // not ready yet, by when they are
  std::map<std::optional<int>, Device> devices_;
};

}  // namespace catgs
