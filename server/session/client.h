#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/session/encoder_allocator.h"
#include "server/session/peer.h"
#include "server/session/session.h"
#include "server/session/session_usage.h"
#include "server/session/spectator_hub.h"

namespace catgs {

class SessionRegistry;

/// Joins a Session to what is around it: the connection that it speaks through, as long as there is
/// one, the executor that makes its frames, the registry with its places. Session thread only.
class Client final : public SessionHost, public std::enable_shared_from_this<Client> {
 public:
  Client(SessionRegistry& registry, std::string session_id, std::string peer_address);
  ~Client() override;  // any thread but the executor's, even after the registry's end

  /// The session speaks through `peer` from here on; a connection that it had before is closed.
  void attach(const std::shared_ptr<Peer>& peer);
  /// Its connection goes over to another client.
  void detach() { peer_.reset(); }
  void on_message(Peer& from, const ClientMessage& message, TimePoint now);
  void on_link(Peer& of, const LinkState& link, TimePoint now);
  void on_frame_sent(Peer& by, const FrameTicket& ticket, std::size_t packet_bytes, TimePoint now);
  /// `by_leaving`: the page was closed, nobody comes back.
  void on_close(Peer& closed, bool by_leaving);
  /// A message that cannot be taken closes the connection it came from.
  void refuse(Peer& from, ErrorCode code, std::string_view why);

  // SessionHost
  AdmissionAnswer admit(const Hello& hello) override;
  SceneAnswer find_scene(const std::string& scene_id) override;
  std::vector<std::string> scene_ids() override;
  std::uint32_t session_count() override;
  void sign(Welcome& welcome) override;
  void send(const ServerMessage& message) override;
  std::vector<std::uint64_t> send(OutgoingFrame frame) override;
  void close(CloseCode code, std::string_view reason) override;
  void open_stream(StreamSettings settings) override;
  std::optional<EncoderChoice> other_encoder(Fault why) override;

  /// Continues the session of a client that was lost, through `peer`.
  void resume(const std::shared_ptr<Peer>& peer, const Hello& hello, Admission admission,
              TimePoint now);
  void add_spectator(const std::shared_ptr<Peer>& peer);
  [[nodiscard]] SpectatorHub& spectators() { return spectators_; }
  [[nodiscard]] const SpectatorHub& spectators() const { return spectators_; }
  /// Of the streams that it opens from here on.
  void use_encoder(EncoderAllocator::Grant grant) { encoder_ = std::move(grant); }
  [[nodiscard]] const EncoderAllocator::Grant& encoder() const { return encoder_; }
  void on_tick(TimePoint now);
  /// Something happened: since when could a frame start?
  void note_readiness(TimePoint now);
  /// Starts the frame that the session's next_frame() announced.
  void start_frame(const FrameCandidate& candidate, TimePoint now);
  [[nodiscard]] Session& session() { return session_; }
  [[nodiscard]] const Session& session() const { return session_; }
  [[nodiscard]] const std::string& peer_address() const { return peer_address_; }
  /// By its token, which is another one when somebody resumes it with another.
  [[nodiscard]] bool may_be_watched() const;
  [[nodiscard]] std::size_t queued_frames() const;
  [[nodiscard]] SessionUsage& usage() { return usage_; }
  [[nodiscard]] const SessionUsage& usage() const { return usage_; }
  [[nodiscard]] bool connected() const { return peer_ != nullptr; }
  [[nodiscard]] std::optional<TimePoint> admitted_at() const { return admitted_at_; }

 private:
  /// An executor's `done` that posts `handle(*this, result)` to the session thread, then lets the
  /// registry look for work.
  template <typename Result, typename Handle>
  std::function<void(Result)> on_session_thread(Handle handle);

  /// An error's line in the log, and its count where a connection ends for it.
  void note_error(const std::string& address, const ErrorMessage& error);
  /// A failed frame's line in the log, and what it says about the device.
  void note_fault(const FrameResult& result);
  /// That a GPU worked for a frame; 0 on the CPU core.
  [[nodiscard]] double device_seconds(const FrameStats& stats) const;

  /// Everything but good-bye and lost decoders is the host's business.
  void on_spectator_message(Peer& from, const ClientMessage& message);
  [[nodiscard]] bool is_host(const Peer& peer) const { return peer_.get() == &peer; }

  SessionRegistry& registry_;
  std::shared_ptr<Peer> peer_;  // null: its connection was lost
  std::string peer_address_;    // of the last one
  const std::shared_ptr<FrameExecutor> executor_;
  std::shared_ptr<Stream> stream_ = std::make_shared<Stream>();
  std::string token_;  // of the hello; a link may open one scene only
  std::vector<Codec> decoders_;
  EncoderAllocator::Grant encoder_;
  std::optional<TimePoint> admitted_at_;
  Session session_;
  SessionUsage usage_;
  std::optional<TimePoint> ready_since_;
  SpectatorHub spectators_;
};

}  // namespace catgs
