#include "server/base/process_metrics.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <utility>

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

namespace catgs {
namespace {

using prometheus::MetricType;

prometheus::MetricFamily family(const char* name, const char* help, MetricType type, double value) {
  prometheus::ClientMetric metric;
  (type == MetricType::Counter ? metric.counter.value : metric.gauge.value) = value;
  return {name, help, type, {metric}};
}

/// Returns a field of /proc/self/stat by its number in proc(5). Fields are counted after the
/// process name, which may contain any byte.
std::optional<std::uint64_t> stat_field(int number) {
  std::ifstream file("/proc/self/stat");
  std::string text((std::istreambuf_iterator<char>(file)), {});
  const auto name_end = text.rfind(')');
  if (name_end == std::string::npos) return std::nullopt;
  std::istringstream fields(text.substr(name_end + 1));
  std::string field;
  for (int n = 3; n < number; ++n) fields >> field;
  std::uint64_t value = 0;
  return fields >> value ? std::optional(value) : std::nullopt;
}

std::optional<double> boot_time_s() {
  std::ifstream file("/proc/stat");
  for (std::string key; file >> key; file.ignore(4096, '\n'))
    if (double value = 0; key == "btime" && file >> value) return value;
  return std::nullopt;
}

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace

double HeapUse::bytes() {
  const std::lock_guard lock(mutex_);
  const TimePoint now = Clock::now();
  if (within(counted_, std::chrono::seconds(30), now)) return bytes_;
  const auto heap = ::mallinfo2();
  counted_ = now;
  return bytes_ = static_cast<double>(heap.uordblks + heap.hblkhd);
}

std::vector<prometheus::MetricFamily> process_metrics() {
  constexpr int start_time_field = 22, resident_pages_field = 24;  // proc(5)
  static HeapUse heap;
  std::vector<prometheus::MetricFamily> families;
  families.push_back(family("process_cpu_seconds_total", "Processor time, user and system",
                            MetricType::Counter, cpu_seconds()));
  if (const auto pages = stat_field(resident_pages_field))
    families.push_back(
        family("process_resident_memory_bytes", "Resident memory", MetricType::Gauge,
               static_cast<double>(*pages) * static_cast<double>(sysconf(_SC_PAGESIZE))));
  families.push_back(family("process_heap_bytes", "Memory that the C library has given out",
                            MetricType::Gauge, heap.bytes()));
  std::error_code error;
  using Folder = std::filesystem::directory_iterator;
  const Folder descriptors("/proc/self/fd", error);
  if (!error)
    families.push_back(family("process_open_fds", "Open file descriptors", MetricType::Gauge,
                              static_cast<double>(std::distance(descriptors, Folder()))));
  if (rlimit limit{}; getrlimit(RLIMIT_NOFILE, &limit) == 0)
    families.push_back(family("process_max_fds", "File descriptors that may be open",
                              MetricType::Gauge, static_cast<double>(limit.rlim_cur)));
  const auto ticks = stat_field(start_time_field);
  if (const auto boot_s = boot_time_s(); boot_s && ticks)
    families.push_back(
        family("process_start_time_seconds", "Start of the process, Unix time", MetricType::Gauge,
               *boot_s + static_cast<double>(*ticks) / static_cast<double>(sysconf(_SC_CLK_TCK))));
  return families;
}

}  // namespace catgs
