#include "server/net/accept_gate.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <unistd.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

// Container engines may allow a billion descriptors, and libwebsockets allocates tables for all of
// them.
constexpr std::uint64_t most_descriptors = 65'536;

}  // namespace

int AcceptGate::usable_descriptors(std::uint64_t allowed) {
  return static_cast<int>(std::min(allowed, most_descriptors));
}

void AcceptGate::raise_descriptor_limit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = static_cast<rlim_t>(usable_descriptors(limit.rlim_max));
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

int AcceptGate::descriptor_limit() {
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  return usable_descriptors(limit.rlim_cur);
}

void AcceptGate::require_room() {
  const int limit = descriptor_limit();
  const int next = ::eventfd(0, 0);  // the lowest number that is free
  if (next >= 0) ::close(next);
  const int taken = next >= 0 ? next : limit;
  const int needed = taken + least_connections + reserved_descriptors;
  if (needed <= limit) return;
  throw InputError(
      "RLIMIT_NOFILE", {},
      fmt::format("{} descriptors are allowed, and at least {} are needed: {} are kept "
                  "for scenes, encoders and the admin port",
                  limit, needed, reserved_descriptors),
      "ulimit -n 1024, or LimitNOFILE=1024 in the unit");
}

AcceptGate::Bounds AcceptGate::bounds_for(int sessions) {
  // A page opens seven connections at most at a time, and reloads overlap with what they replace.
  constexpr int at_least = 256, of_a_session = 12;
  // A burst of `open` comes again after this time.
  constexpr double seconds_to_refill = 8.0;
  const int open = at_least + of_a_session * sessions;
  return {open, open / 4, open / seconds_to_refill};
}

AcceptGate::Address& AcceptGate::known(const std::string& address, TimePoint now) {
  if (addresses_.size() >= most_addresses && !addresses_.contains(address))
    std::erase_if(addresses_, [](const auto& one) { return one.second.open == 0; });
  return addresses_
      .try_emplace(address, Address{.arrivals = {bounds_.per_second,
                                                 static_cast<double>(bounds_.open), now}})
      .first->second;
}

std::optional<std::string> AcceptGate::refusal(int descriptor, int limit,
                                               const std::string& address, TimePoint now) {
  const int usable = limit - reserved_descriptors;
  let_in_.clear();
  if (descriptor >= usable)
    return fmt::format("connection refused: {} descriptors are taken (LimitNOFILE, ulimit -n)",
                       descriptor);
  if (address.empty()) return std::nullopt;
  Address& from = known(address, now);
  if (from.open >= std::min(bounds_.open, usable / 2))
    return fmt::format("connection refused: {} are open already", from.open);
  if (from.silent >= bounds_.silent)
    return fmt::format("connection refused: {} have sent no request yet", from.silent);
  if (!from.arrivals.take(now))
    return fmt::format("connection refused: more than {:.0f} a second", bounds_.per_second);
  let_in_ = address;
  return std::nullopt;
}

void AcceptGate::opened(const void* connection) {
  if (let_in_.empty()) return;
  Address& from = addresses_.at(let_in_);
  ++from.open;
  ++from.silent;
  connections_[connection] = {std::exchange(let_in_, {})};
}

void AcceptGate::requested(const void* connection) {
  const auto found = connections_.find(connection);
  if (found != connections_.end() && std::exchange(found->second.silent, false))
    --addresses_.at(found->second.address).silent;
}

void AcceptGate::closed(const void* connection) {
  requested(connection);
  const auto found = connections_.find(connection);
  if (found == connections_.end()) return;
  --addresses_.at(found->second.address).open;
  connections_.erase(found);
}

}  // namespace catgs
