#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core/flat_buffer.hpp>

#include "tests/load/url.h"

namespace catgs::load {

/// One WebSocket connection, plain or TLS. Operations throw boost::system::system_error. One read
/// and one write may be under way at a time, and close() beside a read.
class Channel {
 public:
  virtual ~Channel() = default;
  Channel() = default;
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;

  /// Resolves, connects, shakes hands with subprotocol catgs.v1. Silence of the server for longer
  /// than `silence` ends the connection from then on. With `via_port` the connection goes to that
  /// port of this machine, where somebody carries it on.
  virtual boost::asio::awaitable<void> connect(const Url& url, const std::string& via_port,
                                               std::chrono::steady_clock::duration silence) = 0;
  /// Replaces the buffer's contents by the next message.
  virtual boost::asio::awaitable<void> read(boost::beast::flat_buffer& message) = 0;
  virtual boost::asio::awaitable<void> write(std::span<const char> message) = 0;
  virtual boost::asio::awaitable<void> close() = 0;
};

std::unique_ptr<Channel> make_channel(const boost::asio::any_io_executor& executor, bool tls,
                                      boost::asio::ssl::context& tls_context);

/// Whether an error of a Channel means that the other side went away, not that the protocol broke.
bool is_disconnection(const boost::system::error_code& error);

}  // namespace catgs::load
