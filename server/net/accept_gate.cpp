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

std::optional<std::string> AcceptGate::refusal(int descriptor, int limit,
                                               const std::string& address) {
  const int usable = limit - reserved_descriptors;
  if (descriptor >= usable)
    return fmt::format("connection refused: {} descriptors are taken (LimitNOFILE, ulimit -n)",
                       descriptor);
  const auto open = open_.find(address);
  if (open != open_.end() && open->second >= usable / 2)
    return fmt::format("connection refused: {} are open already", open->second);
  let_in_ = address;
  return std::nullopt;
}

void AcceptGate::opened(const void* connection) {
  if (let_in_.empty()) return;
  ++open_[let_in_];
  addresses_[connection] = std::exchange(let_in_, {});
}

void AcceptGate::closed(const void* connection) {
  const auto address = addresses_.find(connection);
  if (address == addresses_.end()) return;
  const auto open = open_.find(address->second);
  if (--open->second == 0) open_.erase(open);
  addresses_.erase(address);
}

}  // namespace catgs
