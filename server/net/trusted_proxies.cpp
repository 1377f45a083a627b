#include "server/net/trusted_proxies.h"

#include <algorithm>
#include <optional>
#include <stdexcept>

namespace catgs {
namespace {

namespace ip = boost::asio::ip;

/// Maps an IPv4 peer of a dual-stack socket to its IPv4 address.
ip::address unmapped(const ip::address& address) {
  return address.is_v6() && address.to_v6().is_v4_mapped()
             ? ip::address(ip::make_address_v4(ip::v4_mapped, address.to_v6()))
             : address;
}

/// "192.0.2.1", "192.0.2.1:4711", "2001:db8::1", "[2001:db8::1]:4711".
std::optional<ip::address> parse_address(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return std::nullopt;
  text = text.substr(first, text.find_last_not_of(" \t") - first + 1);
  if (text.starts_with('['))
    text = text.substr(1, std::min(text.find(']'), text.size()) - 1);
  else if (std::ranges::count(text, ':') == 1)
    text = text.substr(0, text.find(':'));
  boost::system::error_code error;
  const ip::address address = ip::make_address(std::string(text), error);
  if (error) return std::nullopt;
  return unmapped(address);
}

template <typename Network, typename Address>
bool contains(const Network& network, const Address& address) {
  return Network(address, network.prefix_length()).canonical() == network.canonical();
}

}  // namespace

std::string limited_as(const std::string& text) {
  constexpr unsigned short prefix_bits = 64;
  const auto address = parse_address(text);
  if (!address || address->is_v4()) return address ? address->to_string() : text;
  const ip::address_v6 unscoped(address->to_v6().to_bytes());
  return ip::make_network_v6(unscoped, prefix_bits).canonical().to_string();
}

TrustedProxies::TrustedProxies(const std::vector<std::string>& networks) {
  for (const std::string& text : networks) {
    const auto slash = text.find('/');
    boost::system::error_code error;
    const ip::address address = ip::make_address(text.substr(0, slash), error);
    const std::string whole =
        slash != std::string::npos ? text : text + (address.is_v4() ? "/32" : "/128");
    if (!error && address.is_v4()) networks_.emplace_back(ip::make_network_v4(whole, error));
    if (!error && address.is_v6()) networks_.emplace_back(ip::make_network_v6(whole, error));
    if (error)
      throw std::invalid_argument("\"" + text + "\" is no network: give 10.0.0.0/8 or 10.1.2.3");
  }
}

bool TrustedProxies::trusts(const ip::address& address) const {
  return std::ranges::any_of(networks_, [&](const auto& network) {
    if (const auto* v4 = std::get_if<ip::network_v4>(&network))
      return address.is_v4() && contains(*v4, address.to_v4());
    return address.is_v6() && contains(std::get<ip::network_v6>(network), address.to_v6());
  });
}

bool TrustedProxies::is_proxy(const std::string& peer) const {
  const auto address = parse_address(peer);
  return address && trusts(*address);
}

std::string TrustedProxies::client_address(const std::string& peer,
                                           std::string_view forwarded_for) const {
  auto client = parse_address(peer);
  if (!client) return peer;
  while (trusts(*client) && !forwarded_for.empty()) {
    const auto comma = forwarded_for.rfind(',');
    const auto begin = comma == std::string_view::npos ? 0 : comma + 1;
    const auto before = parse_address(forwarded_for.substr(begin));
    if (!before) break;
    client = before;
    forwarded_for = forwarded_for.substr(0, begin == 0 ? 0 : comma);
  }
  return client->to_string();
}

}  // namespace catgs
