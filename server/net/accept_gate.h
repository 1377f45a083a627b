#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>

#include "server/base/clock.h"
#include "server/base/rate_limit.h"

namespace catgs {

/// Decides which connections are accepted, because descriptors are limited and the network thread's
/// time is. Without a free descriptor accept() fails forever, and scenes, encoders and probes fail
/// too. Not thread-safe.
class AcceptGate {
 public:
  static constexpr int reserved_descriptors = 64;
  static constexpr int least_connections = 16;  // a visitor's page opens up to seven
  /// The addresses that are remembered while none of their connections is open.
  static constexpr std::size_t most_addresses = 16'384;

  /// The share of one address. An answer ends its connection, so a page of 20 files needs as many.
  struct Bounds {
    int open;
    int silent;  // without a whole request yet: what they cost comes all at once
    double per_second;
  };
  /// For an address that may have so many sessions.
  [[nodiscard]] static Bounds bounds_for(int sessions);

  explicit AcceptGate(const Bounds& bounds) : bounds_(bounds) {}

  /// The usable part of the allowed descriptors: libwebsockets must be able to allocate tables for
  /// them.
  [[nodiscard]] static int usable_descriptors(std::uint64_t allowed);
  /// Raises this process's limit to all usable descriptors that the system allows.
  static void raise_descriptor_limit();
  /// The current limit of this process.
  [[nodiscard]] static int descriptor_limit();
  /// Throws InputError if fewer than least_connections could be accepted now. A server that refuses
  /// everybody, even probes, should not start.
  static void require_room();

  /// The reason to refuse a connection with this descriptor. Nothing: it is accepted, and opened()
  /// follows. The system assigns the lowest free number, so all lower ones are taken. One address
  /// may hold half of the connections at most; without an address (a proxy shares one) only the
  /// descriptors count.
  std::optional<std::string> refusal(int descriptor, int limit, const std::string& address,
                                     TimePoint now);
  /// The connection let in last counts for its address under the key `connection`.
  void opened(const void* connection);
  /// Its first request has come as a whole.
  void requested(const void* connection);
  /// Ends a connection's count. Unknown connections are ignored.
  void closed(const void* connection);

 private:
  struct Address {
    int open = 0;
    int silent = 0;
    RateLimit arrivals;
  };
  struct Connection {
    std::string address;
    bool silent = true;
  };
  Address& known(const std::string& address, TimePoint now);

  const Bounds bounds_;
  std::string let_in_;  // address; empty: does not count
  std::unordered_map<const void*, Connection> connections_;
  std::unordered_map<std::string, Address> addresses_;
};

}  // namespace catgs
