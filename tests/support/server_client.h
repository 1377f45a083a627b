#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "proto/catgs.pb.h"
#include "server/config/config.h"
#include "server/server.h"

namespace catgs::test {

/// synth:city on a port of the system's choice, without an admin port.
ServerConfig quiet_config();

/// Stops a server that runs on another thread, also where a test throws.
class Stopped {
 public:
  explicit Stopped(Server& server) : server_(server) {}
  ~Stopped() { server_.stop(); }
  Stopped(const Stopped&) = delete;
  Stopped& operator=(const Stopped&) = delete;

 private:
  Server& server_;
};

/// A whole server in this process on ports of the system's choice, serving synth:city.
class RunningServer {
 public:
  /// `change` may alter the configuration before the start.
  explicit RunningServer(const std::function<void(ServerConfig&)>& change = {});
  ~RunningServer();  // stop() and join

  [[nodiscard]] int port() const { return server_->port(); }
  [[nodiscard]] int admin_port() const { return server_->admin_port(); }
  void stop() { server_->stop(); }
  void join();

 private:
  std::unique_ptr<Server> server_;
  std::thread thread_;
};

struct HttpReply {
  int status = 0;
  std::map<std::string, std::string> headers;  // lower-case names
  std::string body;
};

/// `target` goes out as it is, unnormalised.
HttpReply http_get(int port, const std::string& target,
                   const std::map<std::string, std::string>& headers = {});

HttpReply http_put(int port, const std::string& target, const std::string& body,
                   const std::map<std::string, std::string>& headers = {});

/// Everything that a server answers to `request`, sent as it is, until it closes the connection or
/// is silent for twenty seconds.
std::string raw_answer(int port, std::string_view request);

/// The value of a gauge or counter without labels.
double metric(const RunningServer& server, const std::string& name);

/// A file for --token-key-file, and a link by its key: to a scene or to all of them.
const std::string& link_key_file();
std::string make_link(const std::string& role, const std::string& scene = {},
                      const std::string& id = {});
/// A file for --token-file, and the token in it.
const std::string& static_token_file();
inline constexpr const char* static_token = "open-sesame-1";
std::map<std::string, std::string> bearer(const std::string& token);

/// Whether the condition comes true. Twenty seconds are a bound against hanging, no measurement.
template <typename Condition>
bool eventually(Condition condition) {
  for (int polls = 0; polls < 1000; ++polls) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return false;
}

struct ReceivedFrame {
  v1::FrameHeader header;
  std::vector<std::byte> bitstream;
};

/// One thing that the server said: a message, a frame, or the end.
struct Received {
  std::optional<v1::ServerMessage> message;
  std::optional<ReceivedFrame> frame;
  bool closed = false;
  int close_code = 0;
};

/// A blocking websocket client. Throws std::runtime_error when nothing comes for twenty seconds: a
/// bound against hanging, not a measurement. Its end drops the connection without a farewell.
class WireClient {
 public:
  struct Options {
    std::string origin;
    std::string subprotocol = "catgs.v1";
    std::string host = {};           // empty: 127.0.0.1 and the port
    std::string forwarded_for = {};  // X-Forwarded-For; empty: none
  };
  /// Throws boost::system::system_error when the handshake is refused.
  explicit WireClient(int port) : WireClient(port, Options()) {}
  WireClient(int port, const Options& options);
  ~WireClient();

  void send(const v1::ClientMessage& message);
  void send_bytes(std::string_view bytes, bool binary = true);
  Received receive();
  /// Skips to the next thing of a kind; throws when the connection closes before.
  v1::ServerMessage receive_message(v1::ServerMessage::BodyCase kind);
  ReceivedFrame receive_frame();
  /// Skips to the end of the connection; the last error message is kept.
  Received receive_until_closed(std::optional<v1::Error>* error = nullptr);

  /// hello -> welcome. `token` may be empty.
  v1::Welcome greet(int width_px = 160, int height_px = 96, v1::Codec codec = v1::CODEC_H264,
                    const std::string& token = {});
  /// The same with a hello of the caller's making.
  v1::Welcome greet(const v1::ClientMessage& hello);
  /// Leads others. Returns once the server has heard it.
  void present(const std::string& name = "Ada");
  /// Closes as a peer of RFC 6455 does, and waits for the answer.
  void close(int code);
  void send_pose(std::uint64_t pose_id, float x = 0.0f);
  void send_ack(std::uint64_t frame_id, bool dropped = false);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

v1::ClientMessage hello_message(int width_px, int height_px, v1::Codec codec);
v1::ClientMessage hello_by(const std::string& token, const std::string& scene = {});
v1::ClientMessage bye_message();
v1::ClientMessage pose_message(std::uint64_t pose_id, float x);

/// The error with which the server closes the connection of a client that says this; empty if it
/// welcomes it or closes without one.
v1::Error refusal(int port, const v1::ClientMessage& message);

/// The hello of a client that was here before; pose 0: without one.
v1::ClientMessage resuming_hello(const std::string& resume_token, std::uint64_t pose_id = 0);

}  // namespace catgs::test
