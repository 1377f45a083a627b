#include "server/net/http.h"

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <variant>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>

#include "render_core/base/content_hash.h"

namespace catgs {
namespace {

/// The host of "a.example:8080" or "[::1]:8080", without port and brackets. Other text gives
/// nothing.
std::string_view host_name(std::string_view authority) {
  const bool brackets = authority.starts_with('[');
  const auto end = brackets ? authority.find(']') : std::min(authority.find(':'), authority.size());
  if (end == authority.npos) return {};
  const std::string_view port = authority.substr(brackets ? end + 1 : end);
  if (!port.empty() &&
      (port.front() != ':' || port.find_first_not_of("0123456789", 1) != port.npos))
    return {};
  return brackets ? authority.substr(1, end - 1) : authority.substr(0, end);
}

/// True if a header with a list of tags, or "*", names this one. False if there is no such
/// resource.
bool names_tag(std::string_view header, std::string_view tag) {
  if (tag.empty()) return false;
  if (header == "*") return true;
  while (!header.empty()) {
    const auto end = std::min(header.find(','), header.size());
    std::string_view one = header.substr(0, end);
    header.remove_prefix(std::min(end + 1, header.size()));
    while (one.starts_with(' ')) one.remove_prefix(1);
    while (one.ends_with(' ')) one.remove_suffix(1);
    if (one == tag) return true;
  }
  return false;
}

/// Returns nothing if the text is no address.
std::variant<std::monostate, in_addr, in6_addr> parse_address(std::string_view address) {
  const std::string text(address);
  if (text.find('\0') != std::string::npos) return {};  // inet_pton() would stop there
  in_addr v4{};
  in6_addr v6{};
  if (::inet_pton(AF_INET, text.c_str(), &v4) == 1) return v4;
  if (::inet_pton(AF_INET6, text.c_str(), &v6) == 1) return v6;
  return {};
}

constexpr std::string_view letters_and_digits =
    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789";

bool has_only(std::string_view text, std::string_view others) {
  return std::ranges::all_of(text, [&](char c) {
    return letters_and_digits.find(c) != text.npos || others.find(c) != text.npos;
  });
}

/// True for an address, or a name that no outsider can register.
bool is_local(std::string_view name) {
  if (name.empty()) return false;
  return parse_address(name).index() > 0 || name.find('.') == name.npos ||
         name.ends_with(".local") || name.ends_with(".internal");
}

std::string in_lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

/// The authority without the port that browsers leave out for this scheme.
std::string_view without_usual_port(std::string_view authority, std::string_view scheme) {
  const std::string_view usual = scheme == "https" ? ":443" : scheme == "http" ? ":80" : "";
  return authority.ends_with(usual) ? authority.substr(0, authority.size() - usual.size())
                                    : authority;
}

/// The host[:port] of "https://a.example:8443"; empty for text that is no origin ("null", "*").
std::string_view authority_of(std::string_view origin) {
  const auto scheme_end = origin.find("://");
  return scheme_end == std::string_view::npos ? "" : origin.substr(scheme_end + 3);
}

}  // namespace

std::string etag_of(std::string_view content) {
  return fmt::format("\"{:016x}\"", content_hash(content));
}

bool Precondition::holds(std::string_view current) const {
  return (if_match.empty() || names_tag(if_match, current)) &&
         (if_none_match.empty() || !names_tag(if_none_match, current));
}

bool origin_allowed(std::string_view origin, std::string_view host,
                    const std::vector<std::string>& allowed) {
  if (origin.empty()) return true;
  if (std::ranges::any_of(allowed, [&](const auto& a) { return a == "*" || a == origin; }))
    return true;
  // Proxies and old clients write the usual port, and names in any case.
  const std::string own = in_lower_case(host), from = in_lower_case(origin);
  const std::string_view scheme = std::string_view(from).substr(0, from.find("://"));
  const std::string_view authority = without_usual_port(authority_of(from), scheme);
  return !authority.empty() && authority == without_usual_port(own, scheme);
}

bool is_loopback(std::string_view address) {
  if (address == "localhost") return true;
  const auto parsed = parse_address(address);
  if (const auto* v4 = std::get_if<in_addr>(&parsed)) return ntohl(v4->s_addr) >> 24 == 127;
  const auto* v6 = std::get_if<in6_addr>(&parsed);
  return v6 && IN6_IS_ADDR_LOOPBACK(v6);
}

void check_origin(std::string_view text, bool any_subdomain) {
  if (text == "null")
    throw std::invalid_argument(
        "\"null\" is every page from a file and every sandboxed frame (serve the page by http, or "
        "give its frame sandbox=\"allow-same-origin\")");
  const std::string lower_case = in_lower_case(text);
  const std::string_view whole = lower_case;
  const auto scheme_end = whole.find("://");
  const bool has_scheme = scheme_end != std::string_view::npos;
  const std::string_view scheme = has_scheme ? whole.substr(0, scheme_end) : "https";
  std::string_view authority = has_scheme ? whole.substr(scheme_end + 3) : whole;
  authority = authority.substr(0, authority.find_first_of("/?#"));
  authority = without_usual_port(authority, scheme);
  std::string_view host = authority;
  if (any_subdomain && host.starts_with("*.")) host.remove_prefix(2);
  if (host.empty() || host.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789.:-_[]") !=
                          std::string_view::npos)
    throw std::invalid_argument(
        fmt::format("\"{}\" is no origin (write it like https://a.example)", text));
  const std::string meant = fmt::format("{}://{}", scheme, authority);
  if (meant != text)
    throw std::invalid_argument(
        fmt::format("\"{}\" is not how browsers write an origin (did you mean {}?)", text, meant));
}

bool host_allowed(std::string_view host, Names names, const std::vector<std::string>& allowed) {
  if (names == Names::all || host.empty()) return true;
  const std::string lower = in_lower_case(host);
  const std::string_view name = host_name(lower);
  return is_loopback(name) || (names == Names::local && is_local(name)) ||
         std::ranges::any_of(allowed, [&](const auto& a) {
           return a == "*" || (!name.empty() && host_name(authority_of(a)) == name);
         });
}

HttpResponse redirect_to_https(std::string_view host, const HttpRequest& request) {
  if (host.empty() || !has_only(host, ".-_:[]"))
    return text_response(400, "400: this port speaks https\n");
  constexpr std::string_view of_addresses = "-._~/=:@,!";
  std::string location =
      fmt::format("https://{}{}", host, percent_encoded(request.path, of_addresses));
  for (std::size_t i = 0; i < request.arguments.size(); ++i)
    location += fmt::format("{}{}", i == 0 ? '?' : '&',
                            percent_encoded(request.arguments[i], of_addresses));
  HttpResponse response =
      text_response(308, fmt::format("308: this port speaks https: {}\n", location));
  response.location = std::move(location);
  return response;
}

std::string percent_encoded(std::string_view text, std::string_view others) {
  std::string out;
  for (const char c : text) {
    if (has_only({&c, 1}, others))
      out += c;
    else
      out += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return out;
}

std::string escape_html(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string content_security_policy(const std::vector<std::string>& embed_origins,
                                    const std::vector<std::string>& media_origins) {
  std::string media;
  for (const auto& origin : media_origins) media.append(" ").append(origin);
  std::string policy = fmt::format(
      "default-src 'none'; script-src 'self'; worker-src 'self'; connect-src 'self'; "
      "img-src 'self' blob: data:{0}; media-src 'self'{0}; style-src 'self'; base-uri 'none'; "
      "form-action 'none'; frame-ancestors",
      media);
  if (embed_origins.empty()) policy += " 'none'";
  for (const auto& origin : embed_origins) policy.append(" ").append(origin);
  return policy;
}

}  // namespace catgs
