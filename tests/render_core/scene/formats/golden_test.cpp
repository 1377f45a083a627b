// Files of older forms load bit for bit as they always did. Those in golden/ were written once, and
// are never written again. The hashes were the same before scenes had models (.ksplat was not
// read).
#include <cstdint>
#include <string>
#include <vector>

#include "render_core/scene/files/load_scene.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

struct Case {
  const char* file;
  std::size_t gaussians;
  int sh_degree;
  std::uint64_t hash;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.file; }

/// FNV-1a of the bytes of all attributes.
std::uint64_t hash_of(const GaussianCloud& cloud) {
  std::uint64_t hash = 0xcbf29ce484222325;
  const auto add = [&](const auto& values) {
    for (const std::byte byte : std::as_bytes(std::span(values)))
      hash = (hash ^ static_cast<std::uint64_t>(byte)) * 0x100000001b3;
  };
  add(cloud.mean);
  add(cloud.rotation);
  add(cloud.scale);
  add(cloud.opacity);
  add(cloud.sh);
  return hash;
}

class Golden : public ::testing::TestWithParam<Case> {};

TEST_P(Golden, FilesLoadAsTheyAlwaysDid) {
  const auto& [file, gaussians, sh_degree, hash] = GetParam();
  const std::filesystem::path folder = CATGS_SOURCE_DIR "/tests/render_core/scene/formats/golden";
  LoadOptions options;
  options.first_view = false;
  const GaussianCloud cloud = load_scene(folder / file, options).cloud;
  EXPECT_EQ(cloud.size(), gaussians);
  EXPECT_EQ(cloud.sh_degree, sh_degree);
  EXPECT_EQ(hash_of(cloud), hash) << std::hex << "0x" << hash_of(cloud);
}

INSTANTIATE_TEST_SUITE_P(Files, Golden,
                         ::testing::Values(Case{"a.compressed.ply", 300, 1, 0x1dae80ee51d61071},
                                           Case{"a.splat", 20, 0, 0x4017b35144edbd05},
                                           Case{"binary.ply", 20, 3, 0x3401f8ec6c8dcc3c},
                                           Case{"level0.ksplat", 20, 2, 0x1dd810255948a428},
                                           Case{"level1.ksplat", 20, 2, 0xa407949b6a1f65d7},
                                           Case{"level2.ksplat", 20, 2, 0x326aa28509e14134},
                                           Case{"text.ply", 20, 0, 0xdc64b26e6bfe5e8f},
                                           Case{"v1.sog", 20, 1, 0x3304ee1d5b833aa8},
                                           Case{"v1.spz", 20, 3, 0x408134ec6d6d49c8},
                                           Case{"v2.sog", 20, 1, 0xf927d1d7da22d0a8},
                                           Case{"v2.spz", 20, 3, 0x8eeeda7b675be50e},
                                           Case{"v3.spz", 20, 3, 0xb2c85eabd044a112}));

}  // namespace
}  // namespace catgs::test
