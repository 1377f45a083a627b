#include "tests/load/channel.h"

#include <type_traits>

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/host_name_verification.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>

#include "tests/load/wire_client.h"

namespace catgs::load {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using asio::use_awaitable;
using PlainStream = beast::tcp_stream;
using TlsStream = beast::ssl_stream<beast::tcp_stream>;

constexpr std::chrono::seconds connect_timeout{5};

template <typename NextLayer>
class WebsocketChannel final : public Channel {
 public:
  template <typename... Arguments>
  explicit WebsocketChannel(Arguments&&... arguments)
      : socket_(std::forward<Arguments>(arguments)...) {}

  asio::awaitable<void> connect(const Url& url, const std::string& via_port,
                                std::chrono::steady_clock::duration silence) override {
    asio::ip::tcp::resolver resolver(socket_.get_executor());
    const std::string host = via_port.empty() ? url.host : "127.0.0.1";
    const std::string& port = via_port.empty() ? url.port : via_port;
    const auto addresses = co_await resolver.async_resolve(host, port, use_awaitable);
    auto& tcp = beast::get_lowest_layer(socket_);
    tcp.expires_after(connect_timeout);
    co_await tcp.async_connect(addresses, use_awaitable);
    tcp.socket().set_option(asio::ip::tcp::no_delay(true));  // poses must not wait for each other
    if constexpr (std::is_same_v<NextLayer, TlsStream>) co_await shake_hands(url);
    tcp.expires_never();  // the WebSocket layer has its own clock
    socket_.set_option(
        websocket::stream_base::timeout{connect_timeout, silence, /*keep_alive_pings=*/false});
    socket_.set_option(websocket::stream_base::decorator([](websocket::request_type& request) {
      request.set(beast::http::field::sec_websocket_protocol, "catgs.v1");
    }));
    socket_.read_message_max(max_server_message_bytes);
    socket_.binary(true);
    co_await socket_.async_handshake(url.authority(), url.path, use_awaitable);
  }

  asio::awaitable<void> read(beast::flat_buffer& message) override {
    message.clear();
    co_await socket_.async_read(message, use_awaitable);
  }

  asio::awaitable<void> write(std::span<const char> message) override {
    co_await socket_.async_write(asio::buffer(message.data(), message.size()), use_awaitable);
  }

  asio::awaitable<void> close() override {
    co_await socket_.async_close(websocket::close_code::normal, use_awaitable);
  }

 private:
  asio::awaitable<void> shake_hands(const Url& url) {
    auto& tls = socket_.next_layer();
    SSL_set_tlsext_host_name(tls.native_handle(), url.host.c_str());
    if (SSL_get_verify_mode(tls.native_handle()) != SSL_VERIFY_NONE)
      tls.set_verify_callback(asio::ssl::host_name_verification(url.host));
    co_await tls.async_handshake(asio::ssl::stream_base::client, use_awaitable);
  }

  websocket::stream<NextLayer> socket_;
};

}  // namespace

std::unique_ptr<Channel> make_channel(const asio::any_io_executor& executor, bool tls,
                                      asio::ssl::context& tls_context) {
  if (tls) return std::make_unique<WebsocketChannel<TlsStream>>(executor, tls_context);
  return std::make_unique<WebsocketChannel<PlainStream>>(executor);
}

bool is_disconnection(const boost::system::error_code& error) {
  return error == asio::error::eof || error == asio::error::connection_reset ||
         error == asio::error::broken_pipe || error == asio::error::not_connected ||
         error == asio::error::operation_aborted || error == websocket::error::closed ||
         error == beast::error::timeout || error == asio::ssl::error::stream_truncated;
}

}  // namespace catgs::load
