#include "tests/support/server_client.h"

#include <algorithm>
#include <cctype>
#include <functional>
#include <stdexcept>

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include "server/access/access.h"
#include "tests/support/raw_socket.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;

constexpr std::chrono::seconds patience{20};

tcp::endpoint loopback(int port) {
  return {asio::ip::make_address("127.0.0.1"), static_cast<std::uint16_t>(port)};
}

/// Runs the asynchronous operation that `start` begins with its handler, for as long as `patience`:
/// Beast's time limits do not hold for blocking calls.
template <typename Start>
beast::error_code run(asio::io_context& io, beast::tcp_stream& stream, Start start) {
  beast::error_code result;
  stream.expires_after(patience);
  start([&result](beast::error_code error, const auto&...) { result = error; });
  io.restart();
  io.run();
  return result;
}

void require(beast::error_code error) {
  if (error) throw beast::system_error(error);
}

ReceivedFrame parse_frame(const std::string& bytes) {
  std::size_t at = 1;
  std::size_t size = 0;
  for (int shift = 0;; shift += 7) {
    const auto byte = static_cast<unsigned char>(bytes.at(at++));
    size |= static_cast<std::size_t>(byte & 0x7f) << shift;
    if ((byte & 0x80) == 0) break;
  }
  ReceivedFrame frame;
  if (!frame.header.ParseFromString(bytes.substr(at, size)))
    throw std::runtime_error("no FrameHeader");
  const auto* rest = reinterpret_cast<const std::byte*>(bytes.data()) + at + size;
  frame.bitstream.assign(rest, reinterpret_cast<const std::byte*>(bytes.data()) + bytes.size());
  return frame;
}

}  // namespace

ServerConfig quiet_config() {
  ServerConfig config;
  config.scenes = {"synth:city:2000"};
  config.port = 0;
  config.admin_bind = "off";
  config.threads = 2;
  config.renderer = RendererKind::cpu;  // whatever this machine has
  return config;
}

RunningServer::RunningServer(const std::function<void(ServerConfig&)>& change) {
  ServerConfig config = quiet_config();
  config.admin_bind = "127.0.0.1:0";
  if (change) change(config);
  server_ = std::make_unique<Server>(config);
  thread_ = std::thread([this] { server_->run(); });
}

RunningServer::~RunningServer() {
  if (thread_.joinable()) {
    stop();
    join();
  }
}

void RunningServer::join() { thread_.join(); }

namespace {

HttpReply exchange(int port, http::request<http::string_body> request,
                   const std::map<std::string, std::string>& headers) {
  asio::io_context io;
  beast::tcp_stream stream(io);
  require(run(io, stream, [&](auto done) { stream.async_connect(loopback(port), done); }));
  request.set(http::field::host, "127.0.0.1:" + std::to_string(port));
  for (const auto& [name, value] : headers) request.set(name, value);
  require(run(io, stream, [&](auto done) { http::async_write(stream, request, done); }));
  beast::flat_buffer buffer;
  http::response<http::string_body> response;
  require(run(io, stream, [&](auto done) { http::async_read(stream, buffer, response, done); }));
  HttpReply reply;
  reply.status = static_cast<int>(response.result_int());
  reply.body = response.body();
  for (const auto& field : response) {
    std::string name(field.name_string());
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
    reply.headers[name] = std::string(field.value());
  }
  return reply;
}

}  // namespace

HttpReply http_get(int port, const std::string& target,
                   const std::map<std::string, std::string>& headers) {
  return exchange(port, {http::verb::get, target, 11}, headers);
}

HttpReply http_put(int port, const std::string& target, const std::string& body,
                   const std::map<std::string, std::string>& headers) {
  http::request<http::string_body> request(http::verb::put, target, 11, body);
  request.prepare_payload();
  return exchange(port, std::move(request), headers);
}

double metric(const RunningServer& server, const std::string& name) {
  const std::string text = http_get(server.admin_port(), "/metrics").body;
  const auto at = text.find("\n" + name + " ");
  if (at == std::string::npos) throw std::runtime_error(name + " is not in /metrics");
  return std::stod(text.substr(at + name.size() + 2));
}

std::string raw_answer(int port, std::string_view request) {
  RawSocket socket(port);
  socket.send(request);
  return socket.receive(patience);
}

namespace {

const std::string link_key(32, 'k');

/// The path of a file with this content, which is there as long as the process.
std::string lasting_file(const char* name, const std::string& content) {
  static const TemporaryFolder folder;
  return folder.write(name, content).string();
}

}  // namespace

const std::string& link_key_file() {
  static const std::string path = lasting_file("key", link_key);
  return path;
}

std::string make_link(const std::string& role, const std::string& scene, const std::string& id) {
  return make_link_token({scene, role, 1'000'000'000'000, id}, link_key);
}

const std::string& static_token_file() {
  static const std::string path =
      lasting_file("tokens", std::string("# museum\n") + static_token + "\n");
  return path;
}

std::map<std::string, std::string> bearer(const std::string& token) {
  return {{"authorization", "Bearer " + token}};
}

struct WireClient::State {
  asio::io_context io;
  websocket::stream<beast::tcp_stream> socket{io};

  template <typename Start>
  beast::error_code run(Start start) {
    return test::run(io, beast::get_lowest_layer(socket), std::move(start));
  }
};

WireClient::WireClient(int port, const Options& options) : state_(std::make_unique<State>()) {
  auto& socket = state_->socket;
  require(state_->run(
      [&](auto done) { beast::get_lowest_layer(socket).async_connect(loopback(port), done); }));
  socket.read_message_max(64u << 20);
  socket.set_option(websocket::stream_base::decorator([&](websocket::request_type& request) {
    if (!options.origin.empty()) request.set(http::field::origin, options.origin);
    if (!options.subprotocol.empty())
      request.set(http::field::sec_websocket_protocol, options.subprotocol);
    if (!options.forwarded_for.empty()) request.set("X-Forwarded-For", options.forwarded_for);
  }));
  const std::string own = "127.0.0.1:" + std::to_string(port);
  const std::string& host = options.host.empty() ? own : options.host;
  require(state_->run([&](auto done) { socket.async_handshake(host, "/", done); }));
}

WireClient::~WireClient() = default;

void WireClient::send(const v1::ClientMessage& message) { send_bytes(message.SerializeAsString()); }

void WireClient::send_bytes(std::string_view bytes, bool binary) {
  state_->socket.binary(binary);
  require(state_->run([&](auto done) {
    state_->socket.async_write(asio::buffer(bytes.data(), bytes.size()), done);
  }));
}

Received WireClient::receive() {
  beast::flat_buffer buffer;
  const auto error = state_->run([&](auto done) { state_->socket.async_read(buffer, done); });
  Received received;
  if (error == beast::error::timeout) throw std::runtime_error("nothing was received");
  if (error) {
    received.closed = true;
    received.close_code = state_->socket.reason().code;
    return received;
  }
  const std::string bytes = beast::buffers_to_string(buffer.data());
  if (bytes.empty()) throw std::runtime_error("an empty message");
  if (bytes[0] == 2) {
    received.frame = parse_frame(bytes);
  } else {
    received.message.emplace();
    if (bytes[0] != 1 || !received.message->ParseFromString(bytes.substr(1)))
      throw std::runtime_error("no ServerMessage");
  }
  return received;
}

v1::ServerMessage WireClient::receive_message(v1::ServerMessage::BodyCase kind) {
  for (;;) {
    Received received = receive();
    if (received.closed) throw std::runtime_error("closed instead of a message");
    if (received.message && received.message->body_case() == kind) return *received.message;
  }
}

ReceivedFrame WireClient::receive_frame() {
  for (;;) {
    Received received = receive();
    if (received.closed) throw std::runtime_error("closed instead of a frame");
    if (received.frame) return *received.frame;
  }
}

Received WireClient::receive_until_closed(std::optional<v1::Error>* error) {
  for (;;) {
    Received received = receive();
    if (received.closed) return received;
    if (error && received.message && received.message->has_error())
      *error = received.message->error();
  }
}

v1::Welcome WireClient::greet(int width_px, int height_px, v1::Codec codec,
                              const std::string& token) {
  auto message = hello_message(width_px, height_px, codec);
  message.mutable_hello()->set_token(token);
  return greet(message);
}

v1::Welcome WireClient::greet(const v1::ClientMessage& hello) {
  send(hello);
  return receive_message(v1::ServerMessage::kWelcome).welcome();
}

void WireClient::present(const std::string& name) {
  v1::ClientMessage message;
  message.mutable_present()->set_on(true);
  message.mutable_present()->set_name(name);
  send(message);
  receive_message(v1::ServerMessage::kLead);
}

void WireClient::close(int code) {
  require(state_->run([&](auto done) {
    state_->socket.async_close(websocket::close_code(static_cast<std::uint16_t>(code)), done);
  }));
}

void WireClient::send_pose(std::uint64_t pose_id, float x) { send(pose_message(pose_id, x)); }

void WireClient::send_ack(std::uint64_t frame_id, bool dropped) {
  v1::ClientMessage message;
  auto& ack = *message.mutable_ack();
  ack.set_frame_id(frame_id);
  ack.set_dropped(dropped);
  if (!dropped) ack.set_presented_us(1);
  send(message);
}

v1::ClientMessage hello_message(int width_px, int height_px, v1::Codec codec) {
  v1::ClientMessage message;
  auto& hello = *message.mutable_hello();
  hello.set_version(1);
  hello.set_viewport_width_px(static_cast<std::uint32_t>(width_px));
  hello.set_viewport_height_px(static_cast<std::uint32_t>(height_px));
  hello.add_decoders(codec);
  return message;
}

v1::ClientMessage hello_by(const std::string& token, const std::string& scene) {
  v1::ClientMessage message = hello_message(64, 64, v1::CODEC_H264);
  message.mutable_hello()->set_token(token);
  message.mutable_hello()->set_scene_id(scene);
  return message;
}

v1::ClientMessage bye_message() {
  v1::ClientMessage message;
  message.mutable_bye();
  return message;
}

v1::Error refusal(int port, const v1::ClientMessage& message) {
  WireClient client(port);
  client.send(message);
  for (v1::Error error;;) {
    const Received received = client.receive();
    if (received.closed) return error;
    if (received.message && received.message->has_welcome()) return {};
    if (received.message && received.message->has_error()) error = received.message->error();
  }
}

v1::ClientMessage pose_message(std::uint64_t pose_id, float x) {
  v1::ClientMessage message;
  auto& pose = *message.mutable_pose();
  pose.set_pose_id(pose_id);
  pose.set_client_time_us(static_cast<std::int64_t>(pose_id) * 1000);
  pose.mutable_world_from_camera()->mutable_position()->set_x(x);
  pose.mutable_world_from_camera()->mutable_orientation()->set_w(1.0f);
  pose.set_fov_y_rad(1.0f);
  return message;
}

v1::ClientMessage resuming_hello(const std::string& resume_token, std::uint64_t pose_id) {
  v1::ClientMessage message = hello_message(160, 96, v1::CODEC_H264);
  auto& resume = *message.mutable_hello()->mutable_resume();
  resume.set_token(resume_token);
  if (pose_id > 0) *resume.mutable_pose() = pose_message(pose_id, 0.1f).pose();
  return message;
}

}  // namespace catgs::test
