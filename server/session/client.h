#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/net/connection.h"
#include "server/pipeline/latest_slot.h"
#include "server/session/rate_limit.h"
#include "server/session/session.h"

namespace catgs {

class SessionRegistry;

/// One connected client: joins its Connection (network thread) to its Session (session thread).
/// Poses wait in a slot where the newest wins; other messages are few, limited in rate, and posted
/// one by one.
class Client final : public ConnectionListener,
                     public SessionHost,
                     public std::enable_shared_from_this<Client> {
 public:
  Client(SessionRegistry& registry, std::shared_ptr<Connection> connection, std::string session_id);
  ~Client() override;  // any thread but the executor's, even after the registry's end

  // Network thread.
  void on_message(std::span<const std::byte> bytes) override;
  void on_frame_sent(const FrameTicket& ticket, std::size_t packet_bytes, TimePoint now) override;
  void on_close() override;

  // Session thread.
  std::variant<Admission, ErrorMessage> admit(const Hello& hello) override;
  std::variant<std::shared_ptr<const SceneEntry>, ErrorMessage> find_scene(
      const std::string& scene_id) override;
  std::vector<std::string> scene_ids() override;
  std::uint32_t session_count() override;
  void send(const ServerMessage& message) override;
  std::vector<std::uint64_t> send(OutgoingFrame frame) override;
  void close(CloseCode code, std::string_view reason) override;
  void open_stream(StreamSettings settings) override;

  /// Starts the frame that the session's next_frame() announced.
  void start_frame(TimePoint now);
  [[nodiscard]] Session& session() { return session_; }
  [[nodiscard]] const Session& session() const { return session_; }
  [[nodiscard]] const Connection& connection() const { return *connection_; }
  [[nodiscard]] bool admitted() const { return admitted_; }

 private:
  struct ReceivedPose {
    PoseSample sample;
    TimePoint received;
  };
  void take_pose();
  /// Posts `handle(*this)` to the session thread, then lets the registry look for work.
  template <typename Handle>
  void post(Handle handle);
  /// An executor's `done` that posts `handle(*this, result)` in the same way.
  template <typename Result, typename Handle>
  std::function<void(Result)> on_session_thread(Handle handle);

  SessionRegistry& registry_;
  const std::shared_ptr<Connection> connection_;

  RateLimit rate_;        // network thread
  bool refused_ = false;  // network thread: nothing more is read
  LatestSlot<ReceivedPose> latest_pose_;

  const std::shared_ptr<FrameExecutor> executor_;
  std::shared_ptr<Stream> stream_ = std::make_shared<Stream>();
  std::string token_;  // of the hello; a link may open one scene only
  bool admitted_ = false;
  Session session_;
};

}  // namespace catgs
