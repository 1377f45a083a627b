#include "tests/support/raw_socket.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>
#include <utility>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace catgs::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds long_patience{20};

bool readable(int descriptor, std::chrono::milliseconds patience) {
  pollfd poller{descriptor, POLLIN, 0};
  return ::poll(&poller, 1, static_cast<int>(patience.count())) > 0;
}

/// Appends what is there; false at the end of the connection.
bool read_some(int descriptor, std::string& to) {
  std::array<char, 16384> piece{};
  const ssize_t got = ::recv(descriptor, piece.data(), piece.size(), 0);
  if (got > 0) to.append(piece.data(), static_cast<std::size_t>(got));
  return got > 0;
}

}  // namespace

RawSocket::RawSocket(int port, bool narrow)
    : descriptor_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  if (narrow) {
    const int bytes = 4096;
    const int segment_bytes = 536;  // the peer's kernel makes room for a number of these
    ::setsockopt(descriptor_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    ::setsockopt(descriptor_, IPPROTO_TCP, TCP_MAXSEG, &segment_bytes, sizeof segment_bytes);
  }
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (descriptor_ < 0 ||
      ::connect(descriptor_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
    const int error = errno;
    if (descriptor_ >= 0) ::close(descriptor_);
    throw std::system_error(error, std::generic_category(), "connect");
  }
}

RawSocket::~RawSocket() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

RawSocket::RawSocket(RawSocket&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)) {}

RawSocket& RawSocket::operator=(RawSocket&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

bool RawSocket::send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  return true;
}

void RawSocket::end_sending() { ::shutdown(descriptor_, SHUT_WR); }

void RawSocket::send_and_close(std::string_view bytes) {
  // The system waits for more, and then sends the end with it.
  ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_MORE);
  ::close(std::exchange(descriptor_, -1));
}

std::string RawSocket::receive(std::chrono::milliseconds patience) {
  std::string received;
  while (readable(descriptor_, patience) && read_some(descriptor_, received)) {
  }
  return received;
}

bool RawSocket::receive_bytes(std::size_t count, std::string& received) {
  const std::size_t wanted = received.size() + count;
  while (received.size() < wanted)
    if (!readable(descriptor_, long_patience) || !read_some(descriptor_, received)) return false;
  return true;
}

bool RawSocket::receive_until(std::string_view text, std::string& received) {
  while (received.find(text) == std::string::npos)
    if (!readable(descriptor_, long_patience) || !read_some(descriptor_, received)) return false;
  return true;
}

bool RawSocket::closed_within(std::chrono::milliseconds patience) {
  const auto deadline = Clock::now() + patience;
  std::string ignored;
  for (;;) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now());
    if (!readable(descriptor_, std::max(left, 0ms))) return false;
    ignored.clear();
    if (!read_some(descriptor_, ignored)) return true;
  }
}

std::string client_frame(std::uint8_t first_byte, std::string_view payload) {
  std::string frame(1, static_cast<char>(first_byte));
  const std::uint64_t size = payload.size();
  const int length_bytes = size < 126 ? 0 : size < 65536 ? 2 : 8;
  const auto length = length_bytes == 0 ? size : length_bytes == 2 ? 126u : 127u;
  frame.push_back(static_cast<char>(0x80 | length));
  for (int shift = 8 * (length_bytes - 1); shift >= 0; shift -= 8)
    frame.push_back(static_cast<char>(size >> shift));
  const std::string_view mask = "\x12\x34\x56\x78";
  frame.append(mask);
  for (std::size_t i = 0; i < payload.size(); ++i)
    frame.push_back(static_cast<char>(payload[i] ^ mask[i % 4]));
  return frame;
}

std::string handshake(int port, std::string_view headers) {
  std::string text = "GET / HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port);
  text +=
      "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: catgs.v1\r\n";
  return text.append(headers).append("\r\n");
}

}  // namespace catgs::test
