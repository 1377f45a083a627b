#include "render_core/scene/files/scene_parts.h"

#include <cmath>

#include "render_core/scene/files/load_scene.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using ::testing::HasSubstr;

class ScenePartsTest : public FolderTest {
 protected:
  const std::shared_ptr<ThreadPool> pool_ = std::make_shared<ThreadPool>(2);
};

TEST_F(ScenePartsTest, HaveTheGaussiansOfTheLoadedScene) {
  GaussianCloud cloud = random_cloud(5000, 1);
  for (std::size_t i = 0; i < cloud.size(); i += 7) cloud.mean[i].x = NAN;
  for (std::size_t i = 0; i < cloud.size(); i += 11) cloud.opacity[i] = 1e-4f;
  cloud.mean[4000].y = 3e7f;  // absurd beside the others
  const auto path = write("a.ply", ply_bytes(cloud));
  write("a.json", R"({"near": 0.125})");
  const Scene whole = load_scene(path);
  ASSERT_EQ(whole.report.absurd, 1u);

  const auto scene = scene_in_parts(path, {}, pool_, 777);
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->hints.near_z, 0.125f);
  for (int pass = 0; pass < 2; ++pass) {
    std::size_t taken = 0, parts = 0;
    const std::uint64_t dropped = scene->parts.each([&](const GaussianCloud& part) {
      ASSERT_LE(taken + part.size(), whole.cloud.size());
      for (std::size_t i = 0; i < part.size(); ++i) {
        ASSERT_EQ(part.mean[i], whole.cloud.mean[taken + i]);
        ASSERT_EQ(part.rotation[i], whole.cloud.rotation[taken + i]);
        ASSERT_EQ(part.opacity[i], whole.cloud.opacity[taken + i]);
        ASSERT_EQ(part.sh_of(i)[3], whole.cloud.sh_of(taken + i)[3]);
      }
      taken += part.size();
      ++parts;
    });
    EXPECT_EQ(taken, whole.cloud.size());
    EXPECT_EQ(parts, 7u);
    EXPECT_EQ(dropped, whole.report.dropped);
  }
}

// A sample of every second row finds the same reach.
TEST_F(ScenePartsTest, JudgeWhatIsAbsurdByASample) {
  GaussianCloud cloud = random_cloud(100'000, 0);
  cloud.mean[77'777].z = -2e8f;
  const auto path = write("a.ply", ply_bytes(cloud));
  std::size_t taken = 0;
  const std::uint64_t dropped =
      scene_in_parts(path, {}, pool_)->parts.each([&](const GaussianCloud& part) {
        taken += part.size();
      });
  EXPECT_EQ(dropped, 1u);
  EXPECT_EQ(taken, load_scene(path).cloud.size());
}

TEST_F(ScenePartsTest, AreNotOfOtherFormats) {
  const GaussianCloud cloud = random_cloud(300, 0);
  for (const auto& path :
       {write("a.spz", encode_spz(cloud, {.version = 3})), write("b.splat", std::string(64, 'x')),
        write("c.ply", encode_compressed_ply(cloud, false)), write("d.splat", "x")})
    EXPECT_FALSE(scene_in_parts(path, {}, pool_)) << path;
}

TEST_F(ScenePartsTest, AFileThatIsCutOffIsRefused) {
  std::string bytes = ply_bytes(random_cloud(300, 0));
  bytes.resize(bytes.size() - 1);
  const auto path = write("a.ply", bytes);
  EXPECT_THAT(input_error([&] { scene_in_parts(path, {}, pool_); }), HasSubstr("cut off"));
}

}  // namespace
}  // namespace catgs::test
