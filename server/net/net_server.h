#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

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
  HttpHandler http;              // pages and /api of the public port
  HttpUploads uploads;           // to the public port
  ConnectionAcceptor accept;     // websockets of subprotocol catgs.v1, on any path
  bool asks_for_tokens = false;  // of who wants to see a scene
  std::vector<std::string> allowed_origins;
  std::vector<std::string> embed_origins;
  std::vector<std::string> trusted_proxies;  // networks, see TrustedProxies
  /// Of each request that is refused before anybody is asked for a session: whose, and why. Of what
  /// libwebsockets refuses itself, the errors that it reports, which name nobody. Called on the
  /// network thread.
  std::function<void(const std::string& line)> on_refused = [](const auto&) {};
  /// The network thread ends although nobody asked it to. Called on it.
  std::function<void()> on_failed = [] {};
  std::string tls_certificate;  // PEM files; both or neither
  std::string tls_key;

  bool admin = false;
  Endpoint admin_listen;
  HttpHandler admin_http;
};

/// HTTP and websockets in one thread of their own around libwebsockets' stock poll loop. Ports are
/// bound by the constructor, so that a busy one is known before scenes are loaded; requests wait in
/// the backlog until start().
class NetServer {
 public:
  /// Throws InputError when an address cannot be bound or a certificate cannot be used.
  explicit NetServer(NetOptions options);
  ~NetServer();  // stop()
  NetServer(const NetServer&) = delete;
  NetServer& operator=(const NetServer&) = delete;

  /// Throws InputError where the system allows too few descriptors for connections beside those
  /// that are open by now.
  void start();
  /// Closes every connection and joins the thread. Listeners see on_close() before it returns.
  void stop();

  [[nodiscard]] int port() const;        // really bound
  [[nodiscard]] int admin_port() const;  // 0 without an admin endpoint

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace catgs
