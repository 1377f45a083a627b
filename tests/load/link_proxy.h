#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/ssl/context.hpp>

#include "tests/load/link.h"

namespace catgs::load {

/// A client's line to the server: listens on the loopback interface, carries every connection on to
/// `host`:`port`, and shapes both directions. Whatever runs over TCP can use it, TLS too. Poses and
/// acks are held back like frames; the handshakes of TCP cost their round trip.
///
/// Buffers of the operating system between it and the server are as small as they may be, so that
/// what the link cannot carry waits where it would wait in truth: in the server's socket. The
/// server's TCP_INFO does not see the link's delay, as the acks of TCP are not shaped.
class LinkProxy {
 public:
  /// Rates count from `begin_us` (see now_us()). Throws boost::system::system_error when nothing
  /// can be listened on.
  LinkProxy(const boost::asio::any_io_executor& executor, std::string host, std::string port,
            LinkSettings link, std::uint64_t seed, std::int64_t begin_us,
            std::uint16_t listen_port = 0);
  ~LinkProxy();

  /// Connections to the server are encrypted from now on, the clients' are not. `tls` has to
  /// outlive the proxy.
  void encrypt(boost::asio::ssl::context& tls);

  /// Takes what clients send, in the order in which they do.
  using Tap = std::function<void(std::span<const std::byte>)>;
  /// Every connection from now on gets a tap of its own.
  void read_along(std::function<Tap()> make_tap);

  /// Where clients connect to: 127.0.0.1 and this port.
  [[nodiscard]] std::string port() const;
  /// Accepts connections until it is cancelled or the proxy is closed.
  boost::asio::awaitable<void> run();
  /// Ends it and all its connections.
  void close();

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace catgs::load
