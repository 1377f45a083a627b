#pragma once

#include <string>
#include <string_view>

namespace catgs::load {

/// A WebSocket address: ws://host[:port][/path] or wss://…; IPv6 hosts in brackets.
struct Url {
  bool tls = false;
  std::string host;  // without brackets
  std::string port;  // "80" and "443" where none is given
  std::string path = "/";

  /// "host:port" for the Host header.
  [[nodiscard]] std::string authority() const;
};

/// Throws InputError.
Url parse_url(std::string_view text);

}  // namespace catgs::load
