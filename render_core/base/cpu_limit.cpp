#include "render_core/base/cpu_limit.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>

#include <sched.h>

namespace catgs {
namespace {

namespace fs = std::filesystem;

constexpr double least_cpus = 0.01;  // the kernel's least quota is 1 ms of 100

int processors_allowed() {
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof(allowed), &allowed) == 0) return CPU_COUNT(&allowed);
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

/// Whether a list such as "rw,cpu,cpuacct" has the controller of quotas.
bool has_cpu(std::string_view list) {
  while (!list.empty()) {
    const std::size_t end = std::min(list.find(','), list.size());
    if (list.substr(0, end) == "cpu") return true;
    list.remove_prefix(std::min(end + 1, list.size()));
  }
  return false;
}

/// A mounted hierarchy of control groups that may hold quotas: a line of /proc/self/mountinfo.
struct Hierarchy {
  bool unified = false;  // cgroup v2
  fs::path root;         // the group that the mount shows at `at`
  fs::path at;
};

std::optional<Hierarchy> parse_mount(const std::string& line) {
  std::istringstream words(line);
  std::string word, root, at, type, source, options;
  words >> word >> word >> word >> root >> at;
  while (words >> word && word != "-") {
  }
  words >> type >> source >> options;
  if (type != "cgroup2" && !(type == "cgroup" && has_cpu(options))) return std::nullopt;
  return Hierarchy{type == "cgroup2", root, at};
}

/// The process's group in a hierarchy, from the lines "ID:CONTROLLERS:PATH" of /proc/self/cgroup.
fs::path group_in(const Hierarchy& hierarchy, const fs::path& root) {
  std::ifstream groups(root / "proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    if (hierarchy.unified ? controllers.empty() : has_cpu(controllers))
      return line.substr(second + 1);
  }
  return "/";
}

/// The group's folder below the mount. A container may see its group's path from outside, while its
/// mount shows only that group.
fs::path folder_of(const fs::path& group, const Hierarchy& hierarchy) {
  const fs::path below = group.lexically_relative(hierarchy.root);
  const bool inside = !below.empty() && *below.begin() != "..";
  return inside ? (hierarchy.at / below).lexically_normal() : hierarchy.at;
}

/// The first numbers of a file; "max" is no number.
std::vector<double> read_numbers(const fs::path& path) {
  std::ifstream file(path);
  std::vector<double> numbers;
  for (double number; numbers.size() < 2 && file >> number;) numbers.push_back(number);
  return numbers;
}

}  // namespace

CpuLimit::CpuLimit(const fs::path& root) {
  std::ifstream mounts(root / "proc/self/mountinfo");
  for (std::string line; std::getline(mounts, line);) {
    const auto hierarchy = parse_mount(line);
    if (!hierarchy) continue;
    const fs::path top = root / hierarchy->at.relative_path();
    fs::path folder = root / folder_of(group_in(*hierarchy, root), *hierarchy).relative_path();
    if (!folder.has_filename()) folder = folder.parent_path();
    for (;; folder = folder.parent_path()) {
      std::error_code error;
      if (hierarchy->unified && fs::exists(folder / "cpu.max", error))
        quotas_.push_back({folder / "cpu.max", {}});
      if (!hierarchy->unified && fs::exists(folder / "cpu.cfs_quota_us", error))
        quotas_.push_back({folder / "cpu.cfs_quota_us", folder / "cpu.cfs_period_us"});
      if (folder == top || !folder.has_relative_path()) break;
    }
  }
}

double CpuLimit::cpus() const {
  double cpus = processors_allowed();
  for (const Quota& quota : quotas_) {
    std::vector<double> numbers = read_numbers(quota.quota_us);
    if (!quota.period_us.empty() && numbers.size() == 1)
      for (const double period : read_numbers(quota.period_us)) numbers.push_back(period);
    if (numbers.size() < 2 || numbers[0] <= 0.0 || numbers[1] <= 0.0) continue;  // -1: no quota
    cpus = std::min(cpus, std::max(numbers[0] / numbers[1], least_cpus));
  }
  return cpus;
}

int threads_for(double cpus) { return std::max(1, static_cast<int>(std::ceil(cpus - 1e-6))); }

}  // namespace catgs
