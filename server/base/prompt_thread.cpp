#include "server/base/prompt_thread.h"

#include <cstdint>

#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace catgs {
namespace {

/// As in linux/sched/types.h, which cannot be included beside glibc's sched.h.
struct SchedulerAttributes {
  std::uint32_t size = sizeof(SchedulerAttributes);
  std::uint32_t policy = SCHED_OTHER;
  std::uint64_t flags = 0;
  std::int32_t nice = 0;
  std::uint32_t priority = 0;
  std::uint64_t runtime_ns = 0;  // of SCHED_OTHER: the slice
  std::uint64_t deadline_ns = 0;
  std::uint64_t period_ns = 0;
};

constexpr std::uint64_t shortest_slice_ns = 100'000;

}  // namespace

void run_promptly() noexcept {
  SchedulerAttributes attributes;
  if (::syscall(SYS_sched_getattr, 0, &attributes, sizeof attributes, 0) != 0) return;
  if (attributes.policy != SCHED_OTHER) return;  // the operator has chosen another policy
  attributes.size = sizeof attributes;
  attributes.runtime_ns = shortest_slice_ns;
  ::syscall(SYS_sched_setattr, 0, &attributes, 0);
}

void run_in_background() noexcept {
  constexpr int nice = 10;  // about a tenth of what another thread gets; with 19 it could starve
  ::setpriority(PRIO_PROCESS, 0, nice);  // of one thread, on Linux
}

}  // namespace catgs
