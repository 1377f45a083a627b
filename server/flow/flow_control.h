#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include <glm/vec2.hpp>

#include "server/flow/credit.h"
#include "server/flow/quality_ladder.h"
#include "server/flow/rate_controller.h"
#include "server/net/connection.h"
#include "server/net/messages.h"

namespace catgs {

/// The upper bounds that a client asks for, within the server's limits.
struct FlowRequest {
  glm::ivec2 size_px{16, 16};
  int fps = 1;
  int bitrate_kbps = 1000;
  bool fixed_quality = false;  // no adaptation; credit still bounds frames in flight
  bool ladder = true;          // false: the bitrate alone adapts

  bool operator==(const FlowRequest&) const = default;
};

/// A still may take 1/13 s (77 ms) of what the link carries. One still that is sharp at once costs
/// three quarters of the bytes of two that become sharp. A camera that moves on waits less than 100
/// ms for it.
inline constexpr int still_fps = 13;

/// Controls what one client is sent, when and how large. It combines credit, the rates of link and
/// decoder, and the quality ladder. Inputs are acknowledgements and the kernel's view of the
/// socket. Pure; not thread-safe.
class FlowControl {
 public:
  FlowControl();

  void set_request(const FlowRequest& request);

  struct SentFrame {
    std::uint64_t frame_id = 0;
    std::size_t bytes = 0;
    glm::ivec2 size_px{0};
    bool still = false;  // excluded from the decoder's measured rate
  };
  /// A frame was handed over to the connection.
  void sent(const SentFrame& frame, TimePoint now);
  void lost(std::uint64_t frame_id) { credit_.lost(frame_id); }
  /// False: the frame is not in flight.
  bool acknowledged(const Ack& ack, TimePoint now);
  void observed(const LinkState& link, TimePoint now);
  /// Sets the frame interval that rendering and encoding reach by themselves.
  void set_real_interval(std::chrono::microseconds interval);
  /// Call it at least four times a second. True: the rung of the ladder has changed.
  bool update(TimePoint now);
  /// Forgets frames in flight: the client shows nothing at the moment and will not acknowledge
  /// them.
  void forget_in_flight() { credit_.reset(); }
  /// Starts over for another connection and perhaps another client clock. Only the rates are kept.
  void forget_path();

  /// True: a frame sent now would not merely queue.
  [[nodiscard]] bool may_send() const;
  /// The encoder's bitrate. The level of the stream allows the request.
  [[nodiscard]] int bitrate_kbps() const;
  /// The bitrate of a still. It is more cautious, because a large frame at a guessed rate makes a
  /// long queue.
  [[nodiscard]] int still_bitrate_kbps(TimePoint now) const;
  /// The time that so many bytes take on the link, as far as its rate is known.
  [[nodiscard]] std::chrono::microseconds time_on_link(std::size_t bytes, TimePoint now) const;
  /// The backlog that the link will still have at `then`, as a duration.
  [[nodiscard]] std::chrono::microseconds standing(TimePoint then) const;
  [[nodiscard]] const QualityLadder& ladder() const { return ladder_; }
  /// The interval between frame starts, for the current rung and decoder.
  [[nodiscard]] std::chrono::microseconds frame_interval() const;
  /// The time from a pose's sample to its picture on the display, at most 100 ms; 0: not known.
  [[nodiscard]] std::chrono::microseconds pose_to_photon() const;

  [[nodiscard]] const CreditWindow& credit() const { return credit_; }
  [[nodiscard]] std::chrono::microseconds queue_delay() const { return network_.queue_delay(); }
  [[nodiscard]] const LinkState& link() const { return link_; }

 private:
  void observe_network(const Ack& ack, const CreditWindow::Settled& settled, TimePoint now);
  void observe_decoder(const Ack& ack, const CreditWindow::Settled& settled, TimePoint now);
  void apply_interval();

  FlowRequest request_;
  CreditWindow credit_;
  RateController network_;  // bits
  RateController decoder_;  // pixels
  QualityLadder ladder_;
  glm::ivec2 frame_size_px_{16, 16};  // of the newest frame in motion
  std::chrono::microseconds real_interval_{0};
  LinkState link_;
  std::optional<TimePoint> link_seen_;
  std::optional<TimePoint> last_sent_;
  std::optional<TimePoint>
      carried_by_;  // when all that was sent will have passed, as a latest bound
  double pose_to_photon_us_ = 0.0;
};

}  // namespace catgs
