#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>

namespace catgs {

/// Which connections are accepted, as descriptors are finite: beyond the last one accept() fails
/// without end, and scenes, encoders and probes find none either. Not thread-safe.
class AcceptGate {
 public:
  static constexpr int reserved_descriptors = 64;
  static constexpr int least_connections = 16;  // a visitor's page opens up to seven

  /// Of as many as are allowed, those that libwebsockets can keep tables of.
  [[nodiscard]] static int usable_descriptors(std::uint64_t allowed);
  /// Raises the limit of this process to what is usable of what the system allows.
  static void raise_descriptor_limit();
  /// Of this process, now.
  [[nodiscard]] static int descriptor_limit();
  /// Throws InputError where fewer than least_connections could be accepted now: a server that
  /// refuses everybody, probes too, is one that should not have started.
  static void require_room();

  /// Why a connection that has this descriptor goes; nothing: it stays, and opened() is next. The
  /// system gives the lowest number that is free: all below it are taken. Of those that may be, one
  /// address has half at most; without an address (a proxy has one for all) there is no bound.
  std::optional<std::string> refusal(int descriptor, int limit, const std::string& address);
  /// The one that was let in last counts for its address from here on, under any name.
  void opened(const void* connection);
  /// Does nothing about others.
  void closed(const void* connection);

 private:
  std::string let_in_;  // address; empty: does not count
  std::unordered_map<const void*, std::string> addresses_;
  std::unordered_map<std::string, int> open_;
};

}  // namespace catgs
