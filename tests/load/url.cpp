#include "tests/load/url.h"

#include <boost/url/parse.hpp>
#include <fmt/format.h>

#include "render_core/base/error.h"

namespace catgs::load {

std::string Url::authority() const {
  const bool ipv6 = host.find(':') != std::string::npos;
  return ipv6 ? fmt::format("[{}]:{}", host, port) : fmt::format("{}:{}", host, port);
}

Url parse_url(std::string_view text) {
  const auto parsed = boost::urls::parse_uri(text);
  const auto scheme = parsed ? parsed->scheme_id() : boost::urls::scheme::unknown;
  const bool tls = scheme == boost::urls::scheme::wss;
  // Boost.URL 1.81 takes "a" of "ws://host:8a" for a path. A token in the address would end up in
  // logs and in the shell's history.
  if ((!tls && scheme != boost::urls::scheme::ws) || parsed->encoded_host().empty() ||
      (!parsed->encoded_path().empty() && !parsed->encoded_path().starts_with('/')) ||
      parsed->has_userinfo() || parsed->has_query() || parsed->has_fragment()) {
    throw InputError("--url", "", fmt::format("\"{}\" is not an address of a server", text),
                     "like ws://127.0.0.1:8080 or wss://example.org; tokens go to --token");
  }
  if (parsed->has_port() && parsed->port_number() == 0) {
    throw InputError(
        "--url", "",
        fmt::format("port {} is not a number from 1 to 65535", std::string(parsed->port())));
  }
  return {.tls = tls,
          .host = parsed->host_address(),
          .port = parsed->has_port() ? std::string(parsed->port())
                  : tls              ? "443"
                                     : "80",
          .path = parsed->encoded_path().empty() ? "/" : std::string(parsed->encoded_path())};
}

}  // namespace catgs::load
