#pragma once

#include <chrono>
#include <cstdint>

#include <glm/vec2.hpp>

#include "server/net/connection.h"
#include "server/net/messages.h"
#include "server/session/credit.h"
#include "server/session/quality_ladder.h"
#include "server/session/rate_controller.h"

namespace catgs {

/// The most that a client wants, within the server's limits.
struct FlowWish {
  glm::ivec2 size_px{16, 16};
  int fps = 1;
  int bitrate_kbps = 1000;
  bool fixed_quality = false;  // the client wants just this; credit still bounds what is in flight

  bool operator==(const FlowWish&) const = default;
};

/// Pictures that stay may each take a second's share at this rate of what the link carries, 77 ms:
/// one that is sharp at once costs three quarters of the bytes of two that become so, and a camera
/// that moves on still waits for less than 100 ms.
inline constexpr int still_fps = 13;

/// What one client may be sent, when, and how large: credit, the rates of its link and of its
/// decoder, the rung of the ladder. It learns from acknowledgements and from what the kernel knows
/// of the socket. Pure; not thread-safe.
class FlowControl {
 public:
  FlowControl();

  void set_wish(const FlowWish& wish);

  struct SentFrame {
    std::uint64_t frame_id = 0;
    std::size_t bytes = 0;
    glm::ivec2 size_px{0};
    bool still = false;  // tells nothing of how fast a decoder takes frames of a moving camera
  };
  /// A frame was handed over to the connection.
  void sent(const SentFrame& frame, TimePoint now);
  void lost(std::uint64_t frame_id) { credit_.lost(frame_id); }
  /// False: the frame is not in flight.
  bool acknowledged(const Ack& ack, TimePoint now);
  void observed(const LinkState& link, TimePoint now);
  /// The session reaches this rate where nothing but rendering and encoding hold it back.
  void set_real_interval(std::chrono::microseconds interval);
  /// At least four times a second. True: another rung of the ladder holds from here on.
  bool update(TimePoint now);
  /// The client shows nothing at the moment: what is in flight will not be acknowledged.
  void forget_in_flight() { credit_.reset(); }
  /// Another connection, perhaps another clock of the client's: only the rates are kept.
  void forget_path();

  /// A frame is worth rendering: its bytes would not only queue.
  [[nodiscard]] bool may_send() const;
  /// What the encoder is to be told. The level of the stream allows the wish.
  [[nodiscard]] int bitrate_kbps() const;
  /// The same of a picture that stays: it is larger, so that a guess would make a longer queue.
  [[nodiscard]] int still_bitrate_kbps(TimePoint now) const;
  /// Of so many bytes, as far as the link is known.
  [[nodiscard]] std::chrono::microseconds time_on_link(std::size_t bytes, TimePoint now) const;
  /// What of all that was sent the link will not have carried by then.
  [[nodiscard]] std::chrono::microseconds standing(TimePoint then) const;
  [[nodiscard]] const Rung& rung() const { return ladder_.rung(); }
  [[nodiscard]] std::size_t steps_down() const { return ladder_.steps_down(); }
  /// Between starts of frames, for the rung and the decoder.
  [[nodiscard]] std::chrono::microseconds frame_interval() const;
  /// From the sample of a pose to its picture on the display, 100 ms at most; 0: not known.
  [[nodiscard]] std::chrono::microseconds pose_to_photon() const;

  [[nodiscard]] const CreditWindow& credit() const { return credit_; }
  [[nodiscard]] std::chrono::microseconds queue_delay() const { return network_.queue_delay(); }
  [[nodiscard]] const LinkState& link() const { return link_; }

 private:
  void observe_network(const Ack& ack, const CreditWindow::Settled& settled, TimePoint now);
  void observe_decoder(const Ack& ack, const CreditWindow::Settled& settled, TimePoint now);
  void observe_pose_age(const Ack& ack);
  void apply_interval();

  FlowWish wish_;
  CreditWindow credit_;
  RateController network_;  // bits
  RateController decoder_;  // pixels
  QualityLadder ladder_;
  glm::ivec2 frame_size_px_{16, 16};  // of the newest frame in motion
  std::chrono::microseconds real_interval_{0};
  LinkState link_;
  TimePoint link_seen_{};
  TimePoint carried_by_{};  // all that was sent, at the latest as acknowledgements tell
  double pose_to_photon_us_ = 0.0;
};

}  // namespace catgs
