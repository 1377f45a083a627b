#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace catgs::test {

/// A TCP connection to this machine that sends whatever bytes it is given: for what no well-behaved
/// client sends. Throws std::system_error when it cannot connect.
class RawSocket {
 public:
  explicit RawSocket(int port, bool narrow = false);  // narrow: its kernel takes little unread
  ~RawSocket();
  RawSocket(RawSocket&& other) noexcept;
  RawSocket& operator=(RawSocket&& other) noexcept;
  RawSocket(const RawSocket&) = delete;
  RawSocket& operator=(const RawSocket&) = delete;

  /// False when the peer has closed.
  bool send(std::string_view bytes);
  /// The peer reads the end of the stream; its answer still comes.
  void end_sending();
  /// Closes with them: a few bytes and the end arrive at the same time.
  void send_and_close(std::string_view bytes);
  /// What arrives until the peer is silent for `patience` or closes.
  std::string receive(std::chrono::milliseconds patience);
  /// Appends as much as that; false when the peer closes before, or is silent for twenty seconds.
  bool receive_bytes(std::size_t count, std::string& received);
  /// Appends to what was received until `text` is in it; false when the peer closes or says nothing
  /// for twenty seconds: a bound against hanging.
  bool receive_until(std::string_view text, std::string& received);
  /// Reads to the end; false when the peer has not closed after `patience`.
  bool closed_within(std::chrono::milliseconds patience);

 private:
  int descriptor_ = -1;
};

/// One masked frame of a websocket client (RFC 6455, 5.2). `first_byte`: FIN, RSV and opcode.
std::string client_frame(std::uint8_t first_byte, std::string_view payload);

constexpr std::uint8_t ws_fin = 0x80, ws_continuation = 0, ws_text = 1, ws_binary = 2, ws_close = 8,
                       ws_ping = 9, ws_pong = 10;

/// A websocket handshake as a browser sends it, with `headers` (whole lines) beside it.
std::string handshake(int port, std::string_view headers = {});

}  // namespace catgs::test
