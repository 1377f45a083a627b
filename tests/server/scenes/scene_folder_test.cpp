#include "server/scenes/scene_folder.h"

#include "render_core/scene/files/save_scene.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_encoder.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

class SceneFolderTest : public FolderTest {
 protected:
  std::vector<std::string> names() {
    std::vector<std::string> names;
    for (const FoundScene& scene : folders_.scan()) names.push_back(scene.name);
    return names;
  }
  /// Another content of the same file, and certainly another time.
  void replace(const std::string& name, std::size_t gaussians) {
    const auto before = std::filesystem::last_write_time(folder_ / name);
    save_scene(random_cloud(gaussians, 0), folder_ / name);
    std::filesystem::last_write_time(folder_ / name, before + std::chrono::seconds(2));
  }

  SceneFolders folders_{{folder_.path()}, {SceneIds({}, {folder_.path()}), {}}};
};

TEST_F(SceneFolderTest, FindsFilesAndFoldersThatAreScenes) {
  EXPECT_THAT(names(), IsEmpty());
  save_scene(random_cloud(10, 0), folder_ / "b.ply");
  save_scene(random_cloud(20, 0), folder_ / "a.splat");
  write("training/point_cloud/iteration_7/point_cloud.ply", ply_bytes(random_cloud(30, 1)));
  for (const auto& [file, content] : encode_sog(random_cloud(40, 0), 2))
    write("sog/" + file, content);
  write("photographs/not_directly_here.ply", ply_bytes(random_cloud(10, 0)));
  save_scene(random_cloud(10, 0), folder_ / ".hidden.ply");
  write("notes.txt", "hello");
  write("b.json", "{}");
  EXPECT_THAT(names(), ElementsAre("a", "b", "sog", "training"));
  EXPECT_EQ(folders_.scan()[3].size.gaussians, 30u);
  EXPECT_EQ(folders_.scan()[3].size.sh_degree, 1);
}

TEST_F(SceneFolderTest, MediaOfASceneAreNoScene) {
  save_scene(random_cloud(10, 0), folder_ / "hall.ply");
  write("hall.media/meta.json", "{}");
  write("hall.media/point_cloud/iteration_7/point_cloud.ply", ply_bytes(random_cloud(30, 1)));
  EXPECT_THAT(names(), ElementsAre("hall"));
}

TEST_F(SceneFolderTest, NamedTwiceHoldsEachSceneOnce) {
  save_scene(random_cloud(10, 0), folder_ / "a.ply");
  const std::string path = folder_.path().string();
  SceneFolders twice({path, path + "/.", path + "/"}, {SceneIds({}, {path, path + "/."}), {}});
  const auto scenes = twice.scan();
  ASSERT_EQ(scenes.size(), 1u);
  EXPECT_EQ(scenes[0].id, folders_.scan()[0].id);
}

TEST_F(SceneFolderTest, SeesWhatIsNewChangedOrGone) {
  save_scene(random_cloud(10, 0), folder_ / "a.ply");
  const auto before = folders_.scan();
  EXPECT_EQ(folders_.scan()[0].stamp, before[0].stamp);
  replace("a.ply", 25);
  const auto after = folders_.scan();
  EXPECT_NE(after[0].stamp, before[0].stamp);
  EXPECT_EQ(after[0].size.gaussians, 25u);
  save_scene(random_cloud(5, 0), folder_ / "b.ply");
  EXPECT_THAT(names(), ElementsAre("a", "b"));
  std::filesystem::remove(folder_ / "a.ply");
  EXPECT_THAT(names(), ElementsAre("b"));
}

TEST_F(SceneFolderTest, SeesThatTheDataBesideAGltfHasChanged) {
  GltfParts parts = encode_gltf(random_cloud(10, 0));
  parts.json["buffers"][0]["uri"] = "a%20b.bin";
  write("a.gltf", parts.json.dump());
  EXPECT_THAT(names(), IsEmpty());
  const auto data = write("a b.bin", parts.binary);  // copied later
  std::filesystem::last_write_time(data, {});        // as a copy that keeps its original's
  EXPECT_THAT(names(), ElementsAre("a"));
  const auto before = folders_.scan()[0].stamp;
  EXPECT_EQ(folders_.scan()[0].stamp, before);
  std::filesystem::last_write_time(data, before.newest + std::chrono::seconds(2));
  EXPECT_NE(folders_.scan()[0].stamp, before);
}

TEST_F(SceneFolderTest, FindsFoldersWithLevels) {
  write("tiles/a.glb", encode_gltf(random_cloud(10, 0)).glb());
  write("tiles/tileset.json",
        R"({"asset": {"version": "1.1"}, "root": {"content": {"uri": "a.glb"}}})");
  write("lcc/meta.lcc2", R"({"splatType": ".spz", "root": {"splatFiles": ["0.spz"],
    "data": {"3dgs": {"name": 0, "count": 20}}}})");
  write("lcc/0.spz", encode_spz(random_cloud(20, 0), {.version = 4}));
  EXPECT_THAT(names(), ElementsAre("lcc", "tiles"));
  EXPECT_EQ(folders_.scan()[0].size.gaussians, 20u);
  EXPECT_TRUE(folders_.scan()[1].location.has_levels());
}

TEST_F(SceneFolderTest, LeavesOutWhatCannotBeReadUntilItChanges) {
  save_scene(random_cloud(10, 0), folder_ / "a.ply");
  write("half.ply", "ply\nformat binary_little_endian 1.0\nelement ver");
  EXPECT_THAT(names(), ElementsAre("a"));
  replace("half.ply", 12);
  EXPECT_THAT(names(), ElementsAre("a", "half"));
}

TEST_F(SceneFolderTest, OffersNoMoreThanItsLimit) {
  save_scene(random_cloud(1, 0), folder_ / "0.splat");
  for (std::size_t i = 1; i <= 10'000; ++i)
    std::filesystem::create_hard_link(folder_ / "0.splat",
                                      folder_ / (std::to_string(i) + ".splat"));
  EXPECT_EQ(names().size(), 10'000u);
}

TEST_F(SceneFolderTest, NamesAFolderThatIsNotThere) {
  SceneFolders absent({folder_ / "absent"}, {SceneIds({}, {}), {}});
  EXPECT_THAT(
      [&] { absent.scan(); },
      ThrowsMessage<InputError>(HasSubstr("--scene-folder " + (folder_ / "absent").string())));
}

}  // namespace
}  // namespace catgs::test
