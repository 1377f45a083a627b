#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <variant>

#include <boost/asio/steady_timer.hpp>

#include "server/visit/admission_desk.h"
#include "server/visit/machine_use.h"
#include "server/visit/place.h"
#include "server/visit/session_report.h"

namespace catgs {

/// Owns all places and accepts connections. A lost visitor's place stays here until it resumes, or
/// until VisitPolicy::resume_grace is over. All functions except accept() and published_json() run
/// on the session thread, so that visits need no lock.
class Places final : public Admissions {
 public:
  explicit Places(VisitContext around);

  /// Any thread. Makes the listener of a new websocket.
  std::shared_ptr<ConnectionListener> accept(std::shared_ptr<Connection> connection);
  /// Any thread. Returns the sessions as JSON, at most one tick old.
  [[nodiscard]] std::string published_json() const { return reports_.json(); }

  /// Tells every client that the server is going away, and admits no more.
  void drain(std::chrono::milliseconds deadline);
  /// Closes the connections that are still open after drain().
  void close_all();
  void stop_timer();
  [[nodiscard]] int connections() const { return connections_; }
  /// Any thread. True if a visitor looked at a scene at the last tick.
  [[nodiscard]] bool anybody_looks() const { return anybody_looks_; }

  // Admissions
  void on_hello(const std::shared_ptr<ClientConnection>& from, std::shared_ptr<Place> newcomer,
                Hello hello, TimePoint now) override;
  AdmissionAnswer admit(Place& place, const Hello& hello) override {
    return desk_.admit(place, hello);
  }
  void follow(Place& place, ClientConnection& from, const Follow& wish, TimePoint now) override;
  void stop_following(Place& place) override;
  Place* leader_of(const ClientConnection& follower) override;
  void leave(Place& place) override;

 private:
  void add(const std::shared_ptr<ClientConnection>& connection,
           const std::shared_ptr<Place>& place);
  void forget_connection(const std::string& address);
  /// Makes the newcomer a spectator of the host, or refuses it.
  void watch(const std::shared_ptr<ClientConnection>& connection, Place& newcomer, Place& host,
             const Hello& hello, TimePoint now);
  /// Returns the presenting session of a watch token, or why nobody may watch it by this access
  /// token.
  std::variant<Place*, ErrorMessage> presenter(const std::string& watch_token,
                                               const std::string& access_token);
  /// Returns the session that a link of role spectator may watch: the one that has presented its
  /// scene for longest. Nothing: the link lets its client move.
  std::optional<std::variant<Place*, ErrorMessage>> presenter_for_spectator(const Hello& hello);
  /// True: a follower gets a visit of its own, and nobody gives up pixels for it.
  bool has_room_for_follower(Hello& hello, Place& host);
  /// Continues the session of a resume token. False: the session cannot continue.
  bool resume(const std::shared_ptr<ClientConnection>& connection, Place& newcomer, Place& known,
              const Hello& hello, TimePoint now);
  /// Tells the company of a place where it is, if its leader wants that.
  void tell_places(Place& host, TimePoint now);
  /// Ends a visit whose link was revoked, and dismisses spectators whose links were.
  void end_revoked(Place& place, const LinkIds& revoked);
  void tick();

  const VisitContext around_;
  PlaceList places_;
  MachineUse machine_{around_};
  AdmissionDesk desk_{around_, places_, machine_};
  SessionReports reports_;
  boost::asio::steady_timer tick_timer_;
  bool stopped_ = false;
  std::atomic<bool> anybody_looks_{false};
  int connections_ = 0;
  std::unordered_map<std::string, int> connections_by_address_;  // by limited_as()
};

}  // namespace catgs
