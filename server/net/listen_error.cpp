#include "server/net/listen_error.h"

#include <cerrno>
#include <memory>
#include <string>
#include <system_error>

#include <fmt/format.h>
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

/// The system's error for listening at an address; 0: none.
int bind_error(const Endpoint& endpoint) {
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST | AI_PASSIVE;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const std::string port = std::to_string(endpoint.port);
  if (::getaddrinfo(endpoint.address.c_str(), port.c_str(), &hints, &found) != 0)
    return EADDRNOTAVAIL;
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> address(found, ::freeaddrinfo);
  const int trial = ::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (trial < 0) return errno;
  const int yes = 1;
  ::setsockopt(trial, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  const int error = ::bind(trial, found->ai_addr, found->ai_addrlen) == 0 ? 0 : errno;
  ::close(trial);
  return error;
}

}  // namespace

void throw_listen_error(const Endpoint& endpoint, const char* flag, const NetOptions* tls) {
  const std::string source = fmt::format("{} {}:{}", flag, endpoint.address, endpoint.port);
  switch (const int error = bind_error(endpoint)) {
    case EADDRINUSE:
      throw InputError(source, {}, "the port is busy: another program listens there",
                       "stop it, or choose another port");
    case EADDRNOTAVAIL:
      throw InputError(source, {}, "this machine has no such address",
                       "give one of its IP addresses, or 0.0.0.0 for all");
    case EACCES:
      throw InputError(source, {}, "this user may not listen on a port below 1024",
                       "choose a higher one, or let a proxy or systemd listen there");
    case 0:
      if (tls)
        throw InputError(
            fmt::format("--tls-cert {} --tls-key {}", tls->tls_certificate, tls->tls_key), {},
            "are no certificate and key, as PEM, that belong together",
            fmt::format("these print the same of a pair: openssl x509 -noout -pubkey -in {}; "
                        "openssl pkey -pubout -in {}",
                        tls->tls_certificate, tls->tls_key));
      throw InputError(source, {}, "libwebsockets cannot listen", "--log-level debug says more");
    default:
      throw InputError(source, {}, "cannot listen: " + std::generic_category().message(error));
  }
}

}  // namespace catgs
