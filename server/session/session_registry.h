#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include "server/metrics.h"
#include "server/schedule/frame_executor.h"
#include "server/schedule/scheduler.h"
#include "server/session/client.h"

namespace catgs {

struct RegistryOptions {
  SessionPolicy policy;
  int max_sessions = 16;
  int max_sessions_per_address = 64;  // a museum behind one address
  int max_waiting = 64;               // connections beyond the sessions: not greeted, or refused
};

/// Why a token does not admit to a scene, for people; nothing: it does.
using Authorize = std::function<std::optional<std::string>(const std::string& token,
                                                           const std::string& scene_id)>;

/// Every session of the server, and the loop that gives them frames. All but accept() and
/// published_json() run on the thread of the io_context (the session thread): sessions need no
/// lock.
class SessionRegistry {
 public:
  /// `scenes` and `encoders` are not empty; the first scene is the default, encoders are best
  /// first.
  SessionRegistry(boost::asio::io_context& io, RegistryOptions options,
                  std::shared_ptr<FrameExecutor> executor,
                  std::vector<std::shared_ptr<const SceneEntry>> scenes,
                  std::vector<EncoderChoice> encoders, Authorize authorize, Metrics& metrics);

  /// Any thread: the listener of a new websocket.
  std::shared_ptr<ConnectionListener> accept(std::shared_ptr<Connection> connection);
  /// Any thread: the sessions as JSON, at most a tick old.
  [[nodiscard]] std::string published_json() const;

  /// Tells every client that the server goes away, and admits nobody any more.
  void drain(std::chrono::milliseconds deadline);
  void stop_timers();
  [[nodiscard]] std::size_t connections() const { return clients_.size(); }

 private:
  friend class Client;
  std::variant<Admission, ErrorMessage> admit(const Hello& hello);
  std::shared_ptr<const SceneEntry> find_scene(const std::string& scene_id) const;
  void add(const std::shared_ptr<Client>& client);
  void remove(const Client& client);
  /// Starts frames while a slot is free and a session is ready; sets the timer for the next one.
  void give_frames();
  void tick();
  void publish();

  boost::asio::io_context& io_;
  const RegistryOptions options_;
  const std::shared_ptr<FrameExecutor> executor_;
  const std::vector<std::shared_ptr<const SceneEntry>> scenes_;
  const std::vector<EncoderChoice> encoders_;
  const Authorize authorize_;
  Metrics& metrics_;

  std::vector<std::shared_ptr<Client>> clients_;
  FrameScheduler scheduler_;
  boost::asio::steady_timer pace_timer_;
  boost::asio::steady_timer tick_timer_;
  bool stopped_ = false;
  bool draining_ = false;
  std::uint32_t admitted_ = 0;
  std::vector<FrameCandidate> candidates_;  // scratch of give_frames()
  std::vector<Client*> candidate_clients_;
  mutable std::mutex published_mutex_;
  std::string published_ = "[]";
};

}  // namespace catgs
