#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/background.h"
#include "server/base/log_event.h"
#include "server/net/connection.h"
#include "server/net/http.h"
#include "server/net/trusted_proxies.h"

namespace catgs {

/// One listening address.
struct Endpoint {
  std::string address = "127.0.0.1";  // IP address; "0.0.0.0" or "::": all interfaces
  int port = 0;                       // 0: the system chooses
};

struct NetOptions {
  Endpoint listen;
  HttpHandler http;     // pages and /api of the public port
  HttpUploads uploads;  // to the public port
  /// True if `http` answers DELETE requests for this path. Others get status 405. Network thread.
  std::function<bool(std::string_view path)> serves_delete = [](std::string_view) { return false; };
  ConnectionAcceptor accept;     // websockets of subprotocol catgs.v1, on any path
  bool asks_for_tokens = false;  // scenes are shown only with a token
  std::vector<std::string> allowed_origins;
  std::vector<std::string> embed_origins;
  std::vector<std::string> media_origins;
  std::vector<std::string> trusted_proxies;  // networks, see TrustedProxies
  int sessions_of_an_address = 64;           // see AcceptGate
  /// Reports each request refused before admission: whose it was, and why. Errors that
  /// libwebsockets itself reports name no client. Called on the network thread.
  std::function<void(const LogFacts& facts, const std::string& text)> on_refused =
      [](const auto&, const auto&) {};
  /// The network thread ended unasked. Called on that thread.
  std::function<void()> on_failed = [] {};
  std::string tls_certificate;  // PEM files; both or neither
  std::string tls_key;

  bool admin = false;
  Endpoint admin_listen;
  HttpHandler admin_http;
};

/// Serves HTTP and websockets on one thread with libwebsockets' poll loop. The constructor binds
/// the ports, so that a busy one is known before scenes are loaded. Requests wait in the backlog
/// until start().
class NetServer {
 public:
  /// `background` reads files, and outlives this object. Throws InputError when an address cannot
  /// be bound or a certificate cannot be used.
  NetServer(NetOptions options, Background& background);
  ~NetServer();  // stop()
  NetServer(const NetServer&) = delete;
  NetServer& operator=(const NetServer&) = delete;

  /// Throws InputError if the system allows too few further descriptors for connections.
  void start();
  /// Closes all connections and joins the thread. Each listener gets on_close() before it returns.
  void stop();

  [[nodiscard]] int port() const;        // really bound
  [[nodiscard]] int admin_port() const;  // 0 without an admin endpoint
  /// Uploads that have a slot. Any thread.
  [[nodiscard]] std::size_t uploads() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace catgs
