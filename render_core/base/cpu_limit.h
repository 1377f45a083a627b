#pragma once

#include <filesystem>
#include <vector>

namespace catgs {

/// How much processor time this process may use: the processors of its affinity mask, cut by the
/// CPU quotas of its control groups, as containers have them (cgroup v2: cpu.max; v1:
/// cpu.cfs_quota_us). std::thread::hardware_concurrency() knows neither.
class CpuLimit {
 public:
  /// Finds the files of the quotas: those of the process's own group and of all groups above it
  /// that are visible. `root` is where /proc is.
  explicit CpuLimit(const std::filesystem::path& root = "/");

  /// Reads the quotas again, since they can change. In seconds of processor time a second, above 0:
  /// half a processor is 0.5. A file that cannot be read limits nothing.
  [[nodiscard]] double cpus() const;

 private:
  struct Quota {
    std::filesystem::path quota_us;
    std::filesystem::path period_us;  // empty: the first file has both numbers
  };
  std::vector<Quota> quotas_;
};

/// The number of threads that CpuLimit keeps busy, at least 1.
int threads_for(double cpus);

}  // namespace catgs
