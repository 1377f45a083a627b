#pragma once

#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <boost/asio/ip/address.hpp>
#include <boost/asio/ip/network_v4.hpp>
#include <boost/asio/ip/network_v6.hpp>

namespace catgs {

/// Whom limits count an address for: an IPv4 address is somebody's, of IPv6 a network of 64 bits
/// is, "2001:db8:1:2::/64". What is no address stays as it is.
std::string limited_as(const std::string& address);

/// Whose X-Forwarded-For is believed. Immutable.
class TrustedProxies {
 public:
  TrustedProxies() = default;
  /// "10.0.0.0/8", "2001:db8::/32", or single addresses. Throws std::invalid_argument.
  explicit TrustedProxies(const std::vector<std::string>& networks);

  /// Whether what connections from `peer` say of their clients is believed.
  [[nodiscard]] bool is_proxy(const std::string& peer) const;

  /// Whom a connection from `peer` belongs to. Each proxy has appended the address that it was
  /// called from: from the right, the first one that is no trusted proxy's is the client's. What
  /// stands left of it the client may have made up. An entry that is no address ends the search.
  [[nodiscard]] std::string client_address(const std::string& peer,
                                           std::string_view forwarded_for) const;

 private:
  [[nodiscard]] bool trusts(const boost::asio::ip::address& address) const;

  std::vector<std::variant<boost::asio::ip::network_v4, boost::asio::ip::network_v6>> networks_;
};

}  // namespace catgs
