#include "tests/load/url.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "render_core/base/error.h"

namespace catgs::load {
namespace {

[[noreturn]] void refuse(std::string_view text, std::string_view what) {
  throw InputError("--url", "", fmt::format("\"{}\" {}", text, what),
                   "like ws://127.0.0.1:8080 or wss://example.org");
}

bool is_port(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && value >= 1 && value <= 65535;
}

}  // namespace

std::string Url::authority() const {
  const bool ipv6 = host.find(':') != std::string::npos;
  return ipv6 ? fmt::format("[{}]:{}", host, port) : fmt::format("{}:{}", host, port);
}

Url parse_url(std::string_view text) {
  Url url;
  std::string_view rest = text;
  if (rest.starts_with("ws://")) {
    rest.remove_prefix(5);
    url.port = "80";
  } else if (rest.starts_with("wss://")) {
    rest.remove_prefix(6);
    url.port = "443";
    url.tls = true;
  } else {
    refuse(text, "does not begin with ws:// or wss://");
  }
  // A token in the address would end up in logs and in the shell's history.
  if (rest.find_first_of("?#@") != std::string_view::npos) {
    refuse(text, "has a query, fragment or user; tokens go to --token");
  }
  const std::size_t slash = std::min(rest.find('/'), rest.size());
  std::string_view authority = rest.substr(0, slash);
  if (slash < rest.size()) url.path = rest.substr(slash);

  std::size_t colon = authority.rfind(':');
  if (authority.starts_with('[')) {
    const std::size_t bracket = authority.find(']');
    if (bracket == std::string_view::npos) refuse(text, "has an open bracket");
    url.host = authority.substr(1, bracket - 1);
    authority.remove_prefix(bracket + 1);
    colon = authority.starts_with(':') ? 0 : std::string_view::npos;
    if (colon != 0 && !authority.empty()) refuse(text, "has something behind its host");
  } else {
    url.host = authority.substr(0, colon);
  }
  if (colon != std::string_view::npos) {
    const std::string_view port = authority.substr(colon + 1);
    if (!is_port(port)) refuse(text, "has a port that is no number of 1 to 65535");
    url.port = port;
  }
  if (url.host.empty()) refuse(text, "has no host");
  return url;
}

}  // namespace catgs::load
