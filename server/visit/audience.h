#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/access/authorize.h"
#include "server/visit/client_connection.h"
#include "server/visit/shared_tour.h"

namespace catgs {

/// The receivers of a visit's frames: its visitor, if connected, and spectators. While the visit
/// hosts a tour, it may also have followers, who get its camera instead. Spectators get the
/// frames as encoded for the visitor, who never waits for them. A spectator that reads too slowly
/// misses frames up to the next IDR. Session thread only.
class Audience {
 public:
  Audience(int max_spectators, std::string address)
      : max_spectators_(static_cast<std::size_t>(max_spectators)), address_(std::move(address)) {}

  /// `connection` becomes the visitor's connection. The previous one is closed.
  void attach(std::shared_ptr<ClientConnection> connection);
  /// The visitor's connection was lost or moves to another session.
  void detach() { visitor_.reset(); }
  /// Null: the visitor's connection was lost.
  [[nodiscard]] const ClientConnection* visitor() const { return visitor_.get(); }
  /// True if the visitor was last welcomed to this scene.
  [[nodiscard]] bool is_in(std::string_view scene_id) const { return scene_id_ == scene_id; }
  /// The address of the visitor's last connection.
  [[nodiscard]] const std::string& address() const { return address_; }
  void close(CloseCode code, std::string_view reason);

  /// Sends to the visitor. Spectators get the messages that concern them too.
  void send(const ServerMessage& message, TimePoint now);
  /// Sends to everybody who can decode the frame. Returns the ids of the visitor's frames that were
  /// dropped.
  std::vector<std::uint64_t> send(OutgoingFrame frame, TimePoint now);

  [[nodiscard]] SharedTour& tour() { return tour_; }
  /// Sends to the visitor and to spectators. The tour sends to followers.
  void tell(const ServerMessage& message, TimePoint now);
  [[nodiscard]] bool full() const { return participants() >= max_spectators_; }
  /// Spectators and followers.
  [[nodiscard]] std::size_t participants() const { return spectators_.size() + tour_.followers(); }
  [[nodiscard]] std::size_t spectators() const { return spectators_.size(); }
  /// The spectator is sent `welcome` first, without the visitor's secrets. Frames follow from the
  /// next IDR on.
  void add(std::shared_ptr<ClientConnection> spectator, Welcome welcome, std::string link_id = {});
  void remove(const ClientConnection& spectator);
  /// The id of a spectator's link; empty: it came by none.
  [[nodiscard]] std::string link_of(const ClientConnection& spectator) const;
  /// The spectators who came by one of these links.
  [[nodiscard]] std::vector<std::shared_ptr<ClientConnection>> spectators_by(
      const LinkIds& link_ids) const;
  /// Handles a farewell or a lost decoder. Spectators' other messages are ignored.
  void on_message(ClientConnection& spectator, const ClientMessage& message);
  /// Call it at least four times a second. True: a spectator waits for an IDR and the last one was
  /// sent a second or more ago.
  [[nodiscard]] bool wants_idr(TimePoint now) const;
  /// Sends everybody what is new about the tour, and spectators a heartbeat after almost a
  /// second of silence. `scene_pass`: signs a new pass of spectators to a scene.
  void keep_talking(TimePoint now,
                    const std::function<std::string(const std::string& scene_id)>& scene_pass);
  /// Ends the tour and closes all spectators' connections. `elsewhere`: the visitor is in
  /// another scene.
  void end_tour(bool elsewhere = false);

 private:
  struct Spectator {
    std::shared_ptr<ClientConnection> connection;
    bool waits_for_idr = true;
    std::string link_id{};
  };
  void tell_spectators(const ServerMessage& message, TimePoint now);

  std::shared_ptr<ClientConnection> visitor_;  // null: lost
  const std::size_t max_spectators_;
  std::string address_;
  std::vector<Spectator> spectators_;
  SharedTour tour_;
  std::string scene_id_;  // as of the last welcome
  std::optional<TimePoint> last_idr_;
  std::optional<TimePoint> last_said_;  // to spectators
};

}  // namespace catgs
