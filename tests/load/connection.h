#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>

#include <boost/asio/steady_timer.hpp>

#include "tests/load/channel.h"
#include "tests/load/decode_stage.h"
#include "tests/load/overscan.h"
#include "tests/load/session.h"
#include "tests/load/wire_client.h"

namespace catgs::load {

/// State that survives a lost connection.
struct SessionState {
  std::string resume_token;
  std::optional<v1::PoseSample> last_pose;
  std::uint64_t next_pose_id = 1;
  Overscan overscan;
};

/// One connection of a session. Its parts are coroutines on one executor: poses, outbox, inbox,
/// decoding, and the bad habits that its settings give it.
class Connection {
 public:
  enum class End { finished, left, lost, refused };

  Connection(const SessionSettings& settings, SessionContext context, SessionState& state,
             SessionReport& report, const boost::asio::any_io_executor& executor);

  /// Lives until the session's stop time, its visitor leaves, or the connection ends. Never throws.
  boost::asio::awaitable<End> run();

 private:
  boost::asio::awaitable<void> send_poses();
  boost::asio::awaitable<void> rest();
  boost::asio::awaitable<void> write_outbox();
  boost::asio::awaitable<void> read_inbox();
  boost::asio::awaitable<void> flood();
  boost::asio::awaitable<void> drop_line();
  boost::asio::awaitable<void> refresh_display();
  [[nodiscard]] double warp_distance(const Pose& camera, const DisplayLog::Frame& frame) const;
  void choose_overscan();
  boost::asio::awaitable<void> attempt(boost::asio::awaitable<void> part);

  void say_hello();
  [[nodiscard]] glm::dvec2 overscan() const;
  [[nodiscard]] v1::Settings wanted_settings() const;
  void say(const v1::ClientMessage& message);
  void acknowledge(v1::Ack ack, std::int64_t presented_us);
  /// Decoded: the next refresh shows it, unless a newer one has come.
  void show(const v1::Ack& ack, std::int64_t decoded_us);
  void take_message(const v1::ServerMessage& message);
  void take_welcome(const v1::Welcome& welcome);
  void take_frame(const FrameMessage& frame);
  [[nodiscard]] bool stalled() const;

  const SessionSettings& settings_;
  SessionState& state_;
  SessionReport& report_;
  std::unique_ptr<Channel> channel_;
  boost::asio::steady_timer welcomed_;       // cancelled when the Welcome is there
  boost::asio::steady_timer outbox_filled_;  // cancelled when there is something to write
  std::deque<std::string> outbox_;
  DecodeStage decode_stage_;
  std::optional<v1::Ack> undisplayed_;  // of the newest decoded frame
  std::uint64_t seen_pose_id_ = 0;      // by the newest refresh
  glm::vec3 focus_{0.0f};               // of the scene
  bool bye_said_ = false;
  std::shared_ptr<const Trajectory> trajectory_;
  std::int64_t hello_us_ = 0;
  std::int64_t begin_us_ = 0;  // of the poses
  bool failed_ = false;
  End end_ = End::lost;
};

}  // namespace catgs::load
