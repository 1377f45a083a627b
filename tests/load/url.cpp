#include "tests/load/url.h"

#include <algorithm>
#include <regex>

#include <fmt/format.h>

#include "render_core/base/error.h"

namespace catgs::load {

std::string Url::authority() const {
  const bool ipv6 = host.find(':') != std::string::npos;
  return ipv6 ? fmt::format("[{}]:{}", host, port) : fmt::format("{}:{}", host, port);
}

Url parse_url(std::string_view text) {
  static const std::regex form(
      R"((wss?)://(\[[0-9A-Fa-f:.]+\]|[^:/?#@[\]]+)(?::([0-9]{1,5}))?(/[^?#@]*)?)");
  std::cmatch parts;
  // A token in the address would end up in logs and in the shell's history.
  if (!std::regex_match(text.data(), text.data() + text.size(), parts, form)) {
    throw InputError("--url", "", fmt::format("\"{}\" is no address of a server", text),
                     "like ws://127.0.0.1:8080 or wss://example.org; tokens go to --token");
  }
  Url url;
  url.tls = parts[1] == "wss";
  url.host = parts[2];
  std::erase_if(url.host, [](char c) { return c == '[' || c == ']'; });
  url.port = parts[3].matched ? parts[3].str() : url.tls ? "443" : "80";
  if (const int port = std::stoi(url.port); port < 1 || port > 65535) {
    throw InputError("--url", "", fmt::format("port {} is no number of 1 to 65535", url.port));
  }
  if (parts[4].matched) url.path = parts[4];
  return url;
}

}  // namespace catgs::load
