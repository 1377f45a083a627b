#include "server/net/accept_gate.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <sys/resource.h>

namespace catgs {
namespace {

// Container engines may allow a billion, and libwebsockets has tables of as many as are allowed.
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
