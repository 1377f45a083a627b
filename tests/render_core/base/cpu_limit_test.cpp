#include "render_core/base/cpu_limit.h"

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace catgs::test {
namespace {

/// What /proc says of a process's groups, and the quotas of those groups.
struct Groups {
  std::string name;
  std::string mounts, groups;
  std::vector<std::pair<std::string, std::string>> files;
  double cpus = 0.0;  // wanted; 0: all
};

const std::string v2 = "30 24 0:26 / /sys/fs/cgroup rw,nosuid - cgroup2 cgroup2 rw,nsdelegate\n";
const std::string v1 =
    "31 24 0:27 /docker/a1 /sys/fs/cgroup/cpu,cpuacct ro shared:9 master:3 - "
    "cgroup cgroup rw,cpu,cpuacct\n";
const std::string v1_others = "32 24 0:28 / /sys/fs/cgroup/cpuset rw - cgroup cgroup rw,cpuset\n";
const std::string v1_folder = "sys/fs/cgroup/cpu,cpuacct/";

const Groups all_groups[] = {
    {"NoGroups", "", "", {}},
    {"Unlimited", v2, "0::/a\n", {{"sys/fs/cgroup/a/cpu.max", "max 100000\n"}}},
    {"HalfAProcessor", v2, "0::/\n", {{"sys/fs/cgroup/cpu.max", "50000 100000\n"}}, 0.5},
    {"TheGroupAboveHasLess",
     v2,
     "0::/pod/box\n",
     {{"sys/fs/cgroup/pod/box/cpu.max", "90000 100000\n"},
      {"sys/fs/cgroup/pod/cpu.max", "25000 100000\n"},
      {"sys/fs/cgroup/other/cpu.max", "1000 100000\n"}},
     0.25},
    {"VersionOneInAContainer",
     v1_others + v1,
     "5:cpuset:/docker/a1\n4:cpu,cpuacct:/docker/a1\n0::/docker/a1\n",
     {{v1_folder + "cpu.cfs_quota_us", "75000\n"}, {v1_folder + "cpu.cfs_period_us", "100000\n"}},
     0.75},
    {"VersionOneBelowItsMount",
     v1,
     "4:cpu,cpuacct:/docker/a1/b2\n",
     {{v1_folder + "b2/cpu.cfs_quota_us", "20000"}, {v1_folder + "b2/cpu.cfs_period_us", "40000"}},
     0.5},
    {"VersionOneWithoutAQuota",
     v1,
     "4:cpu,cpuacct:/docker/a1\n",
     {{v1_folder + "cpu.cfs_quota_us", "-1\n"}, {v1_folder + "cpu.cfs_period_us", "100000\n"}}},
    {"BothVersions",
     v2 + v1,
     "4:cpu,cpuacct:/docker/a1\n0::/\n",
     {{v1_folder + "cpu.cfs_quota_us", "40000"}, {v1_folder + "cpu.cfs_period_us", "100000"}},
     0.4},
    {"NoNumbers", v2, "0::/\n", {{"sys/fs/cgroup/cpu.max", "many\n"}}},
    {"NoPeriod", v2, "0::/\n", {{"sys/fs/cgroup/cpu.max", "50000\n"}}},
    {"TheLeast", v2, "0::/\n", {{"sys/fs/cgroup/cpu.max", "1 1000000\n"}}, 0.01},
};

class CpuLimitOf : public testing::TestWithParam<Groups> {};

TEST_P(CpuLimitOf, IsTheSmallestQuota) {
  const TemporaryFolder root;
  root.write("proc/self/mountinfo", GetParam().mounts);
  root.write("proc/self/cgroup", GetParam().groups);
  for (const auto& [name, content] : GetParam().files) root.write(name, content);
  const double all = CpuLimit(root / "nothing").cpus();
  ASSERT_GE(all, 1.0);
  const double wanted = GetParam().cpus > 0.0 ? GetParam().cpus : all;
  EXPECT_DOUBLE_EQ(CpuLimit(root.path()).cpus(), wanted);
}

INSTANTIATE_TEST_SUITE_P(Groups, CpuLimitOf, testing::ValuesIn(all_groups),
                         [](const auto& test) { return test.param.name; });

TEST(CpuLimit, FollowsAQuotaThatChanges) {
  const TemporaryFolder root;
  root.write("proc/self/mountinfo", v2);
  root.write("proc/self/cgroup", "0::/\n");
  root.write("sys/fs/cgroup/cpu.max", "50000 100000\n");
  const CpuLimit limit(root.path());
  EXPECT_DOUBLE_EQ(limit.cpus(), 0.5);
  root.write("sys/fs/cgroup/cpu.max", "20000 100000\n");
  EXPECT_DOUBLE_EQ(limit.cpus(), 0.2);
}

TEST(CpuLimit, APartOfAProcessorKeepsAThreadBusy) {
  EXPECT_EQ(threads_for(0.01), 1);
  EXPECT_EQ(threads_for(1.0), 1);
  EXPECT_EQ(threads_for(1.5), 2);
  EXPECT_EQ(threads_for(16.0), 16);
}

}  // namespace
}  // namespace catgs::test
