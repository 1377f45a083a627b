#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/visit/client_connection.h"

namespace catgs {

/// A visit that leads others: its followers, and what they are told. Followers have visits of their
/// own and get the leader's camera. Session thread only.
class Presentation {
 public:
  void begin(std::string name, TimePoint now);
  /// Tells the followers that it is over.
  void end();
  /// When it began; nothing: the visit leads nobody.
  [[nodiscard]] std::optional<TimePoint> since() const { return since_; }

  void add(const std::shared_ptr<ClientConnection>& follower);
  void remove(const ClientConnection& follower);
  /// Followers whose connection has ended do not count.
  [[nodiscard]] std::size_t followers() const;

  /// The leader's camera has moved or has come to rest. Followers hear of it, or of a newer one,
  /// within 33 ms or by the next news().
  void moved(const PoseSample& camera, TimePoint now);
  /// Call it at every tick. Tells the followers what is new, and returns it for all others;
  /// nothing: all know it.
  std::optional<Lead> news(std::size_t spectators, bool away, TimePoint now);

 private:
  void tell(const Lead& lead) const;
  void tell_camera(TimePoint now);

  std::optional<TimePoint> since_;
  std::string name_;
  std::optional<Lead> told_;
  std::vector<std::weak_ptr<ClientConnection>> followers_;
  std::optional<PoseSample> camera_;
  std::optional<TimePoint> camera_told_;
  bool camera_is_new_ = false;
};

}  // namespace catgs
