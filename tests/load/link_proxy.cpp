#include "tests/load/link_proxy.h"

#include <algorithm>
#include <deque>
#include <exception>
#include <list>
#include <span>
#include <utility>
#include <vector>

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/connect.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/ssl/host_name_verification.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include "tests/load/clock.h"

namespace catgs::load {
namespace {

namespace asio = boost::asio;
using asio::use_awaitable;
using asio::ip::tcp;

constexpr int socket_buffer_bytes = 16 * 1024;
constexpr std::size_t max_read_bytes = 16 * 1024;
// The far end's receive window: what may be under way behind the bottleneck.
constexpr std::size_t max_in_flight_bytes = std::size_t{4} << 20;
// Segments that arrive within a millisecond are written together.
constexpr std::int64_t wake_interval_us = 1000;

/// The loopback interface has segments of 64 KiB, which no small window lets pass without waiting
/// for timers: use a network's.
template <typename Socket>
void make_small(Socket& socket) {
  const int segment_bytes = LinkShaper::segment_bytes;
  ::setsockopt(socket.native_handle(), IPPROTO_TCP, TCP_MAXSEG, &segment_bytes,
               sizeof segment_bytes);
  socket.set_option(asio::socket_base::receive_buffer_size(socket_buffer_bytes));
}

using TlsStream = asio::ssl::stream<tcp::socket&>;

tcp::socket& socket_of(tcp::socket& socket) { return socket; }
tcp::socket& socket_of(TlsStream& stream) { return stream.next_layer(); }

/// One direction of one connection: two coroutines with the bytes under way between them.
template <typename From, typename To>
class Pipe {
 public:
  /// `tap` may be empty.
  Pipe(From& from, To& to, LinkShaper shaper, std::int64_t begin_us, LinkProxy::Tap tap)
      : from_(from),
        to_(to),
        shaper_(std::move(shaper)),
        begin_us_(begin_us),
        tap_(std::move(tap)),
        filled_(from.get_executor()),
        drained_(from.get_executor()) {}

  /// Until one of the sockets fails or the sender has closed and everything has arrived.
  asio::awaitable<void> run() {
    using namespace asio::experimental::awaitable_operators;
    co_await (receive() && deliver());
  }

 private:
  struct Segment {
    std::int64_t arrival_us = 0;
    std::vector<std::byte> bytes;
  };

  [[nodiscard]] std::int64_t now() const { return now_us() - begin_us_; }

  asio::awaitable<void> sleep_until(asio::steady_timer& timer, std::int64_t time_us) {
    boost::system::error_code woken;
    timer.expires_at(clock_time(std::min(begin_us_ + time_us, LinkShaper::never_us)));
    co_await timer.async_wait(asio::redirect_error(use_awaitable, woken));
  }

  asio::awaitable<void> receive() {
    std::vector<std::byte> buffer(max_read_bytes);
    boost::system::error_code error;
    while (true) {
      const std::size_t room = std::min(
          shaper_.room_bytes(now()), max_in_flight_bytes - std::min(max_in_flight_bytes, bytes_));
      if (room < LinkShaper::segment_bytes) {
        co_await sleep_until(drained_, std::max(shaper_.next_room_us(), now() + wake_interval_us));
        continue;
      }
      const std::size_t count =
          co_await from_.async_read_some(asio::buffer(buffer.data(), std::min(room, buffer.size())),
                                         asio::redirect_error(use_awaitable, error));
      if (error) break;
      if (tap_) tap_({buffer.data(), count});
      push({buffer.data(), count});
    }
    ended_ = true;
    filled_.cancel();
  }

  void push(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const auto segment = bytes.first(std::min(bytes.size(), LinkShaper::segment_bytes));
      bytes = bytes.subspan(segment.size());
      const std::int64_t arrival_us = shaper_.send(segment.size(), now());
      in_flight_.push_back({arrival_us, {segment.begin(), segment.end()}});
      bytes_ += segment.size();
    }
    filled_.cancel();
  }

  asio::awaitable<void> deliver() {
    std::vector<std::byte> due;
    while (true) {
      if (in_flight_.empty()) {
        if (ended_) break;
        co_await sleep_until(filled_, LinkShaper::never_us);
        continue;
      }
      if (const std::int64_t arrival_us = in_flight_.front().arrival_us; arrival_us > now()) {
        co_await sleep_until(filled_, std::max(arrival_us, last_wake_us_ + wake_interval_us));
        continue;
      }
      last_wake_us_ = now();
      due.clear();
      while (!in_flight_.empty() && in_flight_.front().arrival_us <= last_wake_us_) {
        const auto& bytes = in_flight_.front().bytes;
        due.insert(due.end(), bytes.begin(), bytes.end());
        in_flight_.pop_front();
      }
      co_await asio::async_write(to_, asio::buffer(due), use_awaitable);
      bytes_ -= due.size();
      drained_.cancel();
    }
    boost::system::error_code ignored;  // the other side may have gone first
    socket_of(to_).shutdown(tcp::socket::shutdown_send, ignored);
  }

  From& from_;
  To& to_;
  LinkShaper shaper_;
  std::int64_t begin_us_;
  LinkProxy::Tap tap_;
  asio::steady_timer filled_;   // cancelled when there is something to deliver, or never will be
  asio::steady_timer drained_;  // cancelled when something was delivered
  std::deque<Segment> in_flight_;
  std::size_t bytes_ = 0;  // in in_flight_ and in the write under way
  std::int64_t last_wake_us_ = 0;
  bool ended_ = false;
};

}  // namespace

struct LinkProxy::State {
  State(const asio::any_io_executor& executor, std::string server_host, std::string server_port,
        LinkSettings settings, std::uint64_t first_seed, std::int64_t begin,
        std::uint16_t listen_port)
      : acceptor(executor),
        host(std::move(server_host)),
        port(std::move(server_port)),
        link(std::move(settings)),
        seed(first_seed),
        begin_us(begin) {
    const tcp::endpoint here(asio::ip::address_v4::loopback(), listen_port);
    acceptor.open(here.protocol());
    acceptor.set_option(asio::socket_base::reuse_address(true));
    make_small(acceptor);  // its connections inherit it
    acceptor.bind(here);
    acceptor.listen();
  }

  struct Connection {
    explicit Connection(tcp::socket accepted)
        : client(std::move(accepted)), server(client.get_executor()) {}
    tcp::socket client, server;
    asio::cancellation_signal cancel;
  };
  using ConnectionPosition = std::list<Connection>::iterator;

  /// Carries one connection to its end; throws where a socket fails, which is such an end too.
  static asio::awaitable<void> carry(std::shared_ptr<State> state, ConnectionPosition connection) {
    tcp::socket& server = connection->server;
    co_await state->connect(server);
    if (state->tls == nullptr) co_return co_await join(*state, connection->client, server);
    TlsStream encrypted(server, *state->tls);
    if (!SSL_set_tlsext_host_name(encrypted.native_handle(), state->host.c_str()))
      throw std::bad_alloc();
    encrypted.set_verify_callback(asio::ssl::host_name_verification(state->host));
    co_await encrypted.async_handshake(asio::ssl::stream_base::client, use_awaitable);
    co_await join(*state, connection->client, encrypted);
  }

  template <typename Server>
  static asio::awaitable<void> join(State& state, tcp::socket& client, Server& server) {
    using namespace asio::experimental::awaitable_operators;
    const std::uint64_t seed = state.seed + 2 * state.accepted++;
    Pipe down(server, client, {state.link, state.link.down, seed}, state.begin_us, {});
    Pipe up(client, server, {state.link, state.link.up, seed + 1}, state.begin_us,
            state.make_tap ? state.make_tap() : LinkProxy::Tap());
    co_await (down.run() && up.run());
  }

  asio::awaitable<void> connect(tcp::socket& server) {
    asio::steady_timer handshake(server.get_executor(),
                                 std::chrono::microseconds(2 * link.delay_us));
    co_await handshake.async_wait(use_awaitable);
    tcp::resolver resolver(server.get_executor());
    const auto addresses = co_await resolver.async_resolve(host, port, use_awaitable);
    for (auto address = addresses.begin();; ++address) {
      boost::system::error_code error;
      server.open(address->endpoint().protocol());
      make_small(server);
      co_await server.async_connect(*address, asio::redirect_error(use_awaitable, error));
      if (!error) break;
      server.close();
      if (std::next(address) == addresses.end()) throw boost::system::system_error(error);
    }
    server.set_option(tcp::no_delay(true));
  }

  tcp::acceptor acceptor;
  std::string host, port;
  LinkSettings link;
  std::uint64_t seed;
  std::int64_t begin_us;
  std::uint64_t accepted = 0;
  std::function<LinkProxy::Tap()> make_tap;
  asio::ssl::context* tls = nullptr;  // to the server; null: plain
  std::list<Connection> connections;
};

LinkProxy::LinkProxy(const asio::any_io_executor& executor, std::string host, std::string port,
                     LinkSettings link, std::uint64_t seed, std::int64_t begin_us,
                     std::uint16_t listen_port)
    : state_(std::make_shared<State>(executor, std::move(host), std::move(port), std::move(link),
                                     seed, begin_us, listen_port)) {}

void LinkProxy::read_along(std::function<Tap()> make_tap) {
  state_->make_tap = std::move(make_tap);
}

void LinkProxy::encrypt(asio::ssl::context& tls) { state_->tls = &tls; }

LinkProxy::~LinkProxy() { close(); }

std::string LinkProxy::port() const {
  return std::to_string(state_->acceptor.local_endpoint().port());
}

asio::awaitable<void> LinkProxy::run() {
  const std::shared_ptr<State> state = state_;  // the proxy may end first
  while (state->acceptor.is_open()) {
    boost::system::error_code error;
    tcp::socket client =
        co_await state->acceptor.async_accept(asio::redirect_error(use_awaitable, error));
    if (error) break;
    client.set_option(tcp::no_delay(true));
    const auto position = state->connections.emplace(state->connections.end(), std::move(client));
    asio::co_spawn(state->acceptor.get_executor(), State::carry(state, position),
                   asio::bind_cancellation_slot(position->cancel.slot(),
                                                [state, position](const std::exception_ptr&) {
                                                  state->connections.erase(position);
                                                }));
  }
}

void LinkProxy::close() {
  boost::system::error_code ignored;
  state_->acceptor.close(ignored);
  for (auto& connection : state_->connections)
    connection.cancel.emit(asio::cancellation_type::terminal);
}

}  // namespace catgs::load
