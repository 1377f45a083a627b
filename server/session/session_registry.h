#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include "render_core/base/device_set.h"
#include "server/metrics.h"
#include "server/schedule/frame_executor.h"
#include "server/schedule/scheduler.h"
#include "server/session/admission_budget.h"
#include "server/session/admission_queue.h"
#include "server/session/authorize.h"
#include "server/session/client.h"
#include "server/session/encoder_allocator.h"
#include "server/session/encoder_effort.h"
#include "server/session/session_report.h"
#include "server/session/session_tokens.h"

namespace catgs {

/// Of the wall clock, as tokens have it.
std::int64_t unix_now_s();

struct RegistryOptions {
  SessionPolicy policy;
  int max_sessions = 16;
  int min_fps = 10;  // that admission leaves everybody; 0: it counts sessions only
  std::shared_ptr<DeviceSet> devices;  // GPUs that render; null: none
  int cpus = 1;                        // that encode
  EffortControl::Range presets;
  EncoderAllocator::Policy encoders;
  int max_sessions_per_address = 64;  // a museum behind one address
  int max_queue = 64;                 // clients that wait for a place
  int max_spectators = 16;            // of one session
  int max_greeting = 64;              // connections beyond: their hello is to come, or was refused
  std::function<std::int64_t()> wall_clock_s = unix_now_s;  // for tokens; may be set, back too
  /// No device makes Views any more, and frames failed before: only a new process may help.
  std::function<void(const std::string& why)> on_devices_lost = [](const auto&) {};
  std::function<void()> on_tick = [] {};  // the session thread has come round
};

/// Every session of the server, and the loop that gives them frames. All but accept() and
/// published_json() run on the thread of the io_context (the session thread): sessions need no
/// lock.
class SessionRegistry {
 public:
  /// `scenes` outlives the registry; `encoders` are not empty, and best first.
  SessionRegistry(boost::asio::io_context& io, RegistryOptions options,
                  std::shared_ptr<FrameExecutor> executor, SceneSource& scenes,
                  std::vector<EncoderChoice> encoders, Authorize authorize, SessionTokens tokens,
                  Metrics& metrics);

  /// Any thread: the listener of a new websocket.
  std::shared_ptr<ConnectionListener> accept(std::shared_ptr<Connection> connection);
  /// Any thread: the sessions as JSON, at most a tick old.
  [[nodiscard]] std::string published_json() const;

  /// Tells every client that the server goes away, and admits nobody any more.
  void drain(std::chrono::milliseconds deadline);
  /// Closes what drain() has not emptied.
  void close_all();
  void stop_timers();
  [[nodiscard]] int connections() const { return connections_; }

 private:
  friend class Client;
  friend class Peer;
  void add(const std::shared_ptr<Peer>& peer, const std::shared_ptr<Client>& client);
  void forget_connection(const std::string& peer_address);
  /// Leads to the session of a resume token, or begins the newcomer's.
  void on_hello(const std::shared_ptr<Peer>& peer, std::shared_ptr<Client> newcomer, Hello hello,
                TimePoint now);
  /// Lets a newcomer look on at the session of its watch token, or says why not.
  void watch(const std::shared_ptr<Peer>& peer, Client& newcomer, const Hello& hello);
  /// The id of the scene that a hello asks for and may have, if it decodes something, whether there
  /// is a place or not.
  std::variant<std::string, ErrorMessage> choose(const Hello& hello) const;
  /// Continues the session of a resume token. False: it cannot go on.
  bool resume(const std::shared_ptr<Peer>& peer, Client& newcomer, Client& known,
              const Hello& hello, TimePoint now);
  AdmissionAnswer admit(Client& client, const Hello& hello);
  /// What a client that says this hello would get, and what that asks of `present`.
  [[nodiscard]] AdmissionBudget::Offer offer_for(const Hello& hello,
                                                 std::span<const SessionDemand> present) const;
  /// The admitted clients, and their demands as measured, in the same order.
  [[nodiscard]] std::vector<Client*> admitted_clients() const;
  [[nodiscard]] std::vector<SessionDemand> demands() const;
  void set_pixel_share(Client& client, double share);
  /// Gives pixels back where there is room for them again.
  void grow_pictures();
  /// Shares the processor time since the last call out among the sessions.
  void charge_cpu(TimePoint now);
  /// Tells the devices what they were measured to do.
  void report_loads();
  /// Gives one session another encoder effort, where what is measured asks for it.
  void control_effort(TimePoint now);
  void remove(const Client& client);
  /// A frame was rendered, or its device failed.
  void on_device(bool failed) { device_failures_ = failed ? device_failures_ + 1 : 0; }
  /// Each device has failed to make a View. Memory that is short is another matter.
  void on_view_refused(const std::string& why);
  /// Those in the queue who would find room now ask again.
  void ask_waiting(TimePoint now);
  /// The same; the others hear where they stand.
  void admit_waiting(TimePoint now);
  [[nodiscard]] QueuePlace place_in_queue(int position) const;
  [[nodiscard]] std::shared_ptr<Client> find(std::string_view session_id) const;
  SceneAnswer find_scene(const std::string& scene_id, TimePoint now);
  /// Starts frames while a slot is free and a session is ready; sets the timer for the next one.
  void give_frames();
  void tick();
  void publish();

  boost::asio::io_context& io_;
  const RegistryOptions options_;
  const std::shared_ptr<FrameExecutor> executor_;
  SceneSource& scenes_;
  const EncoderAllocator encoders_;
  const Authorize authorize_;
  const SessionTokens tokens_;
  Metrics& metrics_;

  std::vector<std::shared_ptr<Client>> clients_;
  FrameScheduler scheduler_;
  boost::asio::steady_timer pace_timer_;
  boost::asio::steady_timer tick_timer_;
  double cpu_seconds_charged_;
  TimePoint charged_;
  double busy_ = 0.0;  // share of the processors' time that this process takes lately
  bool stopped_ = false;
  bool draining_ = false;
  int connections_ = 0;
  std::unordered_map<std::string, int> connections_by_address_;  // by limited_as()
  std::uint32_t admitted_ = 0;
  int device_failures_ = 0;  // since a frame was rendered
  const AdmissionBudget budget_;
  EffortControl effort_;
  AdmissionQueue queue_;
  std::string turn_;        // the session in the queue that is being asked
  bool measuring_ = false;  // the next in the queue waits for what the present ones cost
  TimePoint queue_told_{};
  std::vector<FrameCandidate> candidates_;  // scratch of give_frames()
  std::vector<Client*> candidate_clients_;
  mutable std::mutex published_mutex_;
  std::shared_ptr<const std::vector<SessionReport>> published_;
};

}  // namespace catgs
