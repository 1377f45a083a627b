#pragma once

#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <boost/asio/ip/address.hpp>
#include <boost/asio/ip/network_v4.hpp>
#include <boost/asio/ip/network_v6.hpp>

namespace catgs {

/// The key by which limits count an address: an IPv4 address itself, or the /64 network of an IPv6
/// address ("2001:db8:1:2::/64"). Text that is no address stays unchanged.
std::string limited_as(const std::string& address);

/// The proxies whose X-Forwarded-For is believed. Immutable.
class TrustedProxies {
 public:
  TrustedProxies() = default;
  /// "10.0.0.0/8", "2001:db8::/32", or single addresses. Throws std::invalid_argument.
  explicit TrustedProxies(const std::vector<std::string>& networks);

  /// True if `peer` is a trusted proxy.
  [[nodiscard]] bool is_proxy(const std::string& peer) const;

  /// The client of a connection from `peer`. Each proxy appends the address that called it. From
  /// the right, the first address that is no trusted proxy is the client; the client may have
  /// forged the rest. The search ends at an entry that is no address.
  [[nodiscard]] std::string client_address(const std::string& peer,
                                           std::string_view forwarded_for) const;

 private:
  [[nodiscard]] bool trusts(const boost::asio::ip::address& address) const;

  std::vector<std::variant<boost::asio::ip::network_v4, boost::asio::ip::network_v6>> networks_;
};

}  // namespace catgs
