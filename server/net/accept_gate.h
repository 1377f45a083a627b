#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>

namespace catgs {

/// Decides which connections are accepted, because descriptors are limited. Without a free
/// descriptor accept() fails forever, and scenes, encoders and probes fail too. Not thread-safe.
class AcceptGate {
 public:
  static constexpr int reserved_descriptors = 64;
  static constexpr int least_connections = 16;  // a visitor's page opens up to seven

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
  /// may hold half of the connections; without an address (a proxy shares one) there is no such
  /// bound.
  std::optional<std::string> refusal(int descriptor, int limit, const std::string& address);
  /// The connection let in last counts for its address under the key `connection`.
  void opened(const void* connection);
  /// Ends a connection's count. Unknown connections are ignored.
  void closed(const void* connection);

 private:
  std::string let_in_;  // address; empty: does not count
  std::unordered_map<const void*, std::string> addresses_;
  std::unordered_map<std::string, int> open_;
};

}  // namespace catgs
