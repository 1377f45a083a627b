#include "render_core/scene/first_sight.h"
#include "render_core/scene/save_scene.h"
#include "render_core/scene/scene.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using ::testing::HasSubstr;

class LoadScene : public TemporaryFolder {};

TEST_F(LoadScene, ReadsWhatSaveSceneWrote) {
  const GaussianCloud cloud = random_cloud(5000, 3);
  save_scene(cloud, folder_ / "room.ply");
  std::vector<double> progress;
  LoadOptions options;
  options.progress = [&](double fraction) { progress.push_back(fraction); };
  const Scene scene = load_scene(folder_ / "room.ply", options);
  EXPECT_EQ(scene.name, "room");
  EXPECT_EQ(scene.format, "3DGS ply");
  EXPECT_EQ(scene.cloud.mean, cloud.mean);
  EXPECT_EQ(scene.cloud.sh, cloud.sh);
  EXPECT_EQ(scene.report.read, 5000u);
  EXPECT_EQ(scene.hints.source, "estimated");
  ASSERT_FALSE(progress.empty());
  EXPECT_TRUE(std::is_sorted(progress.begin(), progress.end()));
  EXPECT_EQ(progress.back(), 1.0);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "room.ply.part"));
}

TEST_F(LoadScene, UnknownFilesAreRefusedWithTheListOfFormats) {
  const auto path = write("notes.txt", "no scene");
  EXPECT_THAT(input_error([&] { load_scene(path); }), HasSubstr("supported: .ply"));
  EXPECT_THAT(input_error([&] { load_scene(write("empty.ply", "")); }), HasSubstr("supported"));
  EXPECT_THAT(input_error([&] { load_scene(folder_ / "absent.ply"); }),
              HasSubstr("does not exist"));
}

TEST_F(LoadScene, SavingNamesUnknownExtensionsAndMissingFolders) {
  const GaussianCloud cloud = random_cloud(3, 0);
  EXPECT_THAT(input_error([&] { save_scene(cloud, folder_ / "a.obj"); }), HasSubstr("'.obj'"));
  EXPECT_THAT(input_error([&] { save_scene(cloud, folder_ / "no" / "a.ply"); }),
              HasSubstr("cannot be written"));
}

TEST(FirstSight, LookAtKeepsUpUprightInTheImage) {
  const glm::vec3 up(0, -1, 0), eye(3, -2, 5), target(0, 0, 1);
  const Pose pose = look_at(eye, target, up);
  const glm::mat3 to_camera = camera_from_world_rotation(pose);
  const glm::vec3 t = to_camera * (target - eye), u = to_camera * up;
  EXPECT_NEAR(t.x, 0.0f, 1e-5f);
  EXPECT_NEAR(t.y, 0.0f, 1e-5f);
  EXPECT_GT(t.z, 0.0f);
  EXPECT_NEAR(u.x, 0.0f, 1e-5f);
  EXPECT_LT(u.y, 0.0f);  // image y points down
  EXPECT_NEAR(glm::determinant(to_camera), 1.0f, 1e-5f);
}

}  // namespace
}  // namespace catgs::test
