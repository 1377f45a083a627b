#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/rate_limit.h"
#include "server/visit/client_connection.h"

namespace catgs {

/// A tour that a visit hosts: its followers, and what they receive. Followers have visits of their
/// own and get the host's camera. Session thread only.
class SharedTour {
 public:
  void begin(const Present& settings, TimePoint now);
  /// Tells the followers that it is over here. `elsewhere`: the host is in another scene.
  void end(bool elsewhere = false);
  /// The host gave this name when it began the tour; empty: it gave none.
  [[nodiscard]] const std::string& name() const { return settings_.name; }
  /// When it began; nothing: the visit hosts no tour.
  [[nodiscard]] std::optional<TimePoint> since() const { return since_; }

  void add(const std::shared_ptr<ClientConnection>& follower);
  void remove(const ClientConnection& follower);
  /// Followers whose connection has ended do not count.
  [[nodiscard]] std::size_t followers() const;
  [[nodiscard]] bool has(const ClientConnection& follower) const;

  /// The host's camera has moved or has come to rest. Followers hear of it, or of a newer one,
  /// within 33 ms or by the next news(), 30 times a second at most.
  void moved(const PoseSample& camera, TimePoint now);
  /// Takes what the visit sees of the scene's tours, whether it hosts or not. The next news() tell
  /// it.
  void show(const Show& shown) { shown_ = shown; }
  /// Call it at every tick. Tells the followers what is new, and returns it for all others;
  /// nothing: all know it. Once an hour it comes with a new pass for spectators.
  std::optional<Lead> news(std::size_t spectators, bool away, TimePoint now,
                           const std::function<std::string()>& scene_pass);
  /// The visit is in another scene now, where its camera has not been yet.
  void forget_camera() {
    camera_.reset();
    shown_ = {};
  }
  /// The newest camera of the visit, whether it hosts or not.
  [[nodiscard]] const std::optional<PoseSample>& camera() const { return camera_; }

  /// Tells the followers of a ping. False: it is not allowed, or one of too many.
  bool ping(const Pinged& pinged, TimePoint now);
  /// Whether all participants hear where all are.
  [[nodiscard]] bool tells_positions() const { return since_ && settings_.tells_places; }
  /// Where all participants are now. Tells the followers, and returns true for all others, if that
  /// is new and they heard of it half a second ago or more.
  bool tell(const Participants& participants, TimePoint now);
  /// Where all participants were when they heard of it last.
  [[nodiscard]] const Participants& positions_told() const { return positions_told_; }

 private:
  /// The news of a tour that is under way.
  [[nodiscard]] Lead lead(LeadState state, std::size_t participants) const;
  void tell_followers(const ServerMessage& message) const;
  void tell_camera(TimePoint now);

  std::optional<TimePoint> since_;
  TimePoint passes_renewed_{};
  Present settings_;
  std::optional<Lead> told_;
  std::vector<std::weak_ptr<ClientConnection>> followers_;
  std::optional<PoseSample> camera_;
  TimePoint next_camera_{};  // followers hear of the camera from then on
  bool camera_is_new_ = false;
  Show shown_;
  std::optional<RateLimit> pings_;
  Participants positions_told_;
  std::optional<TimePoint> positions_told_at_;
};

}  // namespace catgs
