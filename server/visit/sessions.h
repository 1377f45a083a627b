#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <variant>

#include <boost/asio/steady_timer.hpp>

#include "server/visit/admission_controller.h"
#include "server/visit/machine_use.h"
#include "server/visit/session.h"
#include "server/visit/session_report.h"

namespace catgs {

/// Owns all sessions and accepts connections. A lost visitor's session stays here until it resumes,
/// or until VisitPolicy::resume_grace is over. All functions except accept() and published_json()
/// run on the session thread, so that visits need no lock.
class Sessions final : public Admissions {
 public:
  explicit Sessions(VisitContext around);

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
  void on_hello(const std::shared_ptr<ClientConnection>& from, std::shared_ptr<Session> newcomer,
                Hello hello, TimePoint now) override;
  AdmissionAnswer admit(Session& session, const Hello& hello) override {
    return admission_.admit(session, hello);
  }
  void follow(Session& session, ClientConnection& from, const Follow& request,
              TimePoint now) override;
  void stop_following(Session& session) override;
  Session* host_of(const ClientConnection& follower) override;
  void leave(Session& session) override;

 private:
  void add(const std::shared_ptr<ClientConnection>& connection,
           const std::shared_ptr<Session>& session);
  void forget_connection(const std::string& address);
  /// Makes the newcomer a spectator of the host, or refuses it.
  void watch(const std::shared_ptr<ClientConnection>& connection, Session& newcomer, Session& host,
             const Hello& hello, TimePoint now);
  /// Returns the session that hosts the tour of a watch token, or why nobody may watch it by this
  /// access token.
  std::variant<Session*, ErrorMessage> tour_host(const std::string& watch_token,
                                                 const std::string& access_token);
  /// Returns the session that a link of role spectator may watch: the one that has hosted a
  /// tour of its scene for longest. Nothing: the link lets its client move.
  std::optional<std::variant<Session*, ErrorMessage>> host_for_spectator(const Hello& hello);
  /// True: a follower gets a visit of its own, and nobody gives up pixels for it.
  bool has_room_for_follower(Hello& hello, Session& host);
  /// Continues the session of a resume token. False: the session cannot continue.
  bool resume(const std::shared_ptr<ClientConnection>& connection, Session& newcomer,
              Session& known, const Hello& hello, TimePoint now);
  /// Tells the participants of a tour where all are, if its host wants that.
  void tell_positions(Session& host, TimePoint now);
  /// Ends a visit whose link was revoked, and dismisses spectators whose links were.
  void end_revoked(Session& session, const LinkIds& revoked);
  void tick();

  const VisitContext around_;
  SessionList sessions_;
  MachineUse machine_{around_};
  AdmissionController admission_{around_, sessions_, machine_};
  SessionReports reports_;
  boost::asio::steady_timer tick_timer_;
  bool stopped_ = false;
  std::atomic<bool> anybody_looks_{false};
  int connections_ = 0;
  std::unordered_map<std::string, int> connections_by_address_;  // by limited_as()
};

}  // namespace catgs
