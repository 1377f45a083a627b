#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/log_event.h"
#include "server/counts/visit_tally.h"
#include "server/visit/audience.h"
#include "server/visit/session_usage.h"
#include "server/visit/visit.h"
#include "server/visit/visit_context.h"

namespace catgs {

class Session;
using SessionList = std::vector<std::shared_ptr<Session>>;

/// The owner of all sessions, as one session sees it.
class Admissions {
 public:
  virtual ~Admissions() = default;
  /// Hands the connection to the session of its resume or watch token, or begins the newcomer's
  /// visit.
  virtual void on_hello(const std::shared_ptr<ClientConnection>& from,
                        std::shared_ptr<Session> newcomer, Hello hello, TimePoint now) = 0;
  virtual AdmissionAnswer admit(Session& session, const Hello& hello) = 0;
  /// `from`, the session's visitor, follows another session from now on, or none.
  virtual void follow(Session& session, ClientConnection& from, const Follow& request,
                      TimePoint now) = 0;
  /// The session's visitor follows nobody any more, and gets a message.
  virtual void stop_following(Session& session) = 0;
  /// The session whose tour this client follows; null: none.
  virtual Session* host_of(const ClientConnection& follower) = 0;
  /// The session's visit has ended.
  virtual void leave(Session& session) = 0;
};

/// Asks for a scene that this server may not have.
SceneAnswer find_scene(SceneSource& scenes, const std::string& scene_id, TimePoint now);

/// The visitor, as of the last hello, and what it was granted.
struct Visitor {
  std::string token;    // it may be valid for one scene only
  std::string link_id;  // of the token; empty: it is no link
  DeviceKind device = DeviceKind::unknown;
  EncoderChoice encoder;  // of the streams that are opened from here on
  std::optional<TimePoint> admitted_at;

  void come_by(const std::string& by, const Authorize& authorize) {
    token = by;
    link_id = authorize(by).link_id;
  }
};

/// Rates of the requests that a visit may make, beside its pictures.
struct RequestLimits {
  RateLimit shared_tours{2.0, 8.0, Clock::now()};
  RateLimit pings{2.0, 2.0, Clock::now()};
  RateLimit preparations{0.1, 3.0, Clock::now()};
  /// Refusals that get an answer. A flood costs neither answers nor lines of the log.
  RateLimit refusals{1.0, 1.0, Clock::now()};
};

/// A client's session: its Visit, its Audience, its stream on the executor and its usage of the
/// machine. Code that changes the Visit from outside must tell Frames. Session thread
/// only.
class Session final : public VisitHost, public std::enable_shared_from_this<Session> {
 public:
  /// `around` and `admissions` outlive the session, except for its destructor.
  Session(const VisitContext& around, Admissions& admissions, std::string session_id,
          std::string address);
  ~Session() override;  // any thread but the executor's

  // Called by its connections.
  void on_message(ClientConnection& from, const ClientMessage& message, const LinkState& link,
                  TimePoint received);
  void on_frame_sent(ClientConnection& by, const FrameTicket& ticket, std::size_t packet_bytes,
                     TimePoint now);
  /// `by_leaving`: the page was closed and the visitor will not come back.
  void on_close(ClientConnection& closed, bool by_leaving);
  /// Closes the connection of a message that cannot be accepted.
  void refuse(ClientConnection& from, ErrorCode code, std::string_view why);

  // VisitHost
  AdmissionAnswer admit(const Hello& hello) override { return admissions_.admit(*this, hello); }
  SceneAnswer find_scene(const std::string& name) override;
  void sign(Welcome& welcome) override;
  void send(const ServerMessage& message) override;
  std::vector<std::uint64_t> send(OutgoingFrame frame) override;
  void close(CloseCode code, std::string_view reason) override { audience_.close(code, reason); }
  void open_stream(StreamSettings settings) override;
  std::optional<EncoderChoice> other_encoder(Fault why) override;

  /// `sessions`: of the server.
  void on_tick(TimePoint now, int sessions);
  /// Accounts for a frame's result and its cost.
  void account_for(const FrameResult& result, TimePoint now);
  /// True if the visitor's token allows spectators. A resume may bring another token.
  [[nodiscard]] bool may_be_watched() const;
  [[nodiscard]] std::optional<FrameCandidate> next_frame() const { return visit_.next_frame(); }
  [[nodiscard]] const std::string& id() const { return id_; }
  /// The facts of log lines about it. Valid until the visit's next event.
  [[nodiscard]] LogFacts facts() const;
  [[nodiscard]] Visit& visit() { return visit_; }
  [[nodiscard]] Audience& audience() { return audience_; }
  [[nodiscard]] Visitor& visitor() { return visitor_; }
  [[nodiscard]] SessionUsage& usage() { return usage_; }
  [[nodiscard]] const std::shared_ptr<Stream>& stream() const { return stream_; }

 private:
  const VisitContext& around_;
  Admissions& admissions_;
  const std::string id_;
  const std::shared_ptr<FrameExecutor> executor_;
  std::shared_ptr<Stream> stream_ = std::make_shared<Stream>();
  Visitor visitor_;
  Visit visit_;
  SessionUsage usage_;
  Audience audience_;
  VisitTally tally_;
  RequestLimits limits_;
};

/// A pass of the host's spectators to the tours and media of the scene, by the host's token.
std::string scene_pass(const VisitContext& around, const Visitor& host,
                       const std::string& scene_id);

/// Returns null if no session has this id.
std::shared_ptr<Session> find_session(const SessionList& sessions, std::string_view session_id);

}  // namespace catgs
