#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>

#include "server/encode/encoder.h"
#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// How many encoders of each kind are open, of those whose number a driver limits: NVENC on GPUs
/// for desktops opens a few and then refuses. A limit is either told or learnt by being refused; a
/// learnt one is tried again after a minute, since other programs take places too. Thread-safe.
class EncoderSeats : public std::enable_shared_from_this<EncoderSeats> {
 public:
  /// A place; its end gives it back.
  class Seat {
   public:
    Seat(std::shared_ptr<EncoderSeats> of, EncoderKind kind) : of_(std::move(of)), kind_(kind) {}
    ~Seat();
    Seat(const Seat&) = delete;
    Seat& operator=(const Seat&) = delete;
    [[nodiscard]] EncoderKind kind() const { return kind_; }

   private:
    const std::shared_ptr<EncoderSeats> of_;
    const EncoderKind kind_;
  };

  /// At most so many of a kind; without a call the limit is learnt.
  void set_limit(EncoderKind kind, int limit);
  /// Null: all are taken.
  [[nodiscard]] std::shared_ptr<const Seat> take(EncoderKind kind, TimePoint now);
  /// An encoder with a seat could not be opened: no more than the others fit.
  void refused(const Seat& seat, TimePoint now);
  [[nodiscard]] std::map<EncoderKind, int> taken() const;

 private:
  struct Kind {
    int taken = 0;
    std::optional<int> told;
    std::optional<int> learnt;
    TimePoint learnt_at{};
  };
  static bool has_room(const Kind& kind, TimePoint now);

  mutable std::mutex mutex_;
  std::map<EncoderKind, Kind> kinds_;
};

}  // namespace catgs
