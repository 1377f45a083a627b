#include "server/scenes/scene_ids.h"

#include "server/base/scene_id.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

std::string id_in(const std::vector<std::string>& folders, const std::string& path,
                  const std::string& name = "hall") {
  return SceneIds({}, folders).id_of(path, name);
}

TEST(SceneIds, DependOnThePathAlone) {
  const std::string id = id_in({"/data/a"}, "/data/a/hall.ply");
  EXPECT_EQ(name_in(id), "hall");
  EXPECT_EQ(id_in({"/data/b", "/data/a"}, "/data/a/hall.ply"), id) << "another folder beside it";
  EXPECT_NE(id_in({"/data/b", "/data/a"}, "/data/b/hall.ply"), id);
  EXPECT_NE(id_in({"/data/a"}, "/data/a/hall.sog"), id) << "another file beside it";
  EXPECT_NE(id_in({"/data/a"}, "/data/a/hall"), id);
}

TEST(SceneIds, SurviveAnotherMountPoint) {
  const std::string id = id_in({"/data/a"}, "/data/a/hall.ply");
  EXPECT_EQ(id_in({"/mnt/disk/a/"}, "/mnt/disk/a/hall.ply"), id);
  EXPECT_EQ(id_in({"/mnt/./disk/a"}, "/mnt/./disk/a/hall.ply"), id);
  EXPECT_NE(id_in({"/data/c"}, "/data/c/hall.ply"), id) << "a folder of another name";
  EXPECT_EQ(SceneIds({"/srv/a/hall.ply"}, {}).id_of("/srv/a/hall.ply", "hall"), id)
      << "named by --scene";
}

/// Two folders of one name are told apart by their paths, and one that is left by itself does not
/// take the place of the other.
TEST(SceneIds, FoldersOfOneNameAreToldApart) {
  const std::vector<std::string> both = {"/x/scenes", "/y/scenes"};
  const std::string x = id_in(both, "/x/scenes/hall.ply"), y = id_in(both, "/y/scenes/hall.ply");
  EXPECT_NE(x, y);
  EXPECT_EQ(id_in({"/y/scenes", "/x/scenes"}, "/x/scenes/hall.ply"), x) << "in whatever order";
  EXPECT_NE(id_in({"/y/scenes"}, "/y/scenes/hall.ply"), x);
  EXPECT_NE(id_in({"/x/scenes"}, "/x/scenes/hall.ply"), y);
  EXPECT_EQ(SceneIds({"/x/scenes/other.ply"}, {"/y/scenes"}).id_of("/y/scenes/hall.ply", "hall"), y)
      << "a folder of --scene counts";
}

TEST(SceneIds, AFolderIsOneSceneByWhateverFileItIsNamed) {
  const std::string id = id_in({"/data"}, "/data/hall");
  EXPECT_EQ(id_in({"/data"}, "/data/hall/"), id);
  for (const char* file : {"/data/hall/lod-meta.json", "/data/hall/meta.json"})
    EXPECT_EQ(SceneIds({file}, {}).id_of(file, "hall"), id) << file;
}

TEST(SceneKey, IsOneForAllWaysToAFolder) {
  const TemporaryFolder folder;
  folder.write("rooms/hall.ply", "");
  folder.write("rooms/attic/meta.json", "");
  std::filesystem::create_directory_symlink(folder / "rooms", folder / "current");
  std::filesystem::create_symlink("hall.ply", folder / "rooms/copy.ply");
  const auto key = [&](const std::string& path) { return scene_key((folder / path).string()); };
  EXPECT_EQ(key("current/hall.ply"), key("rooms/hall.ply"));
  EXPECT_EQ(key("current/../rooms/./hall.ply"), key("rooms/hall.ply"));
  EXPECT_EQ(key("current/attic/meta.json"), key("rooms/attic"));
  EXPECT_NE(key("rooms/copy.ply"), key("rooms/hall.ply")) << "it has a sidecar of its own";
  EXPECT_EQ(key("absent/hall.ply"), (folder / "absent/hall.ply").string());
}

/// What a link points at may change, as the content of a file may. The sidecar lies beside it.
TEST(SceneIds, SymbolicLinksArePathsOfTheirOwn) {
  const TemporaryFolder folder;
  folder.write("release_41/hall.ply", "");
  std::filesystem::create_directory_symlink(folder / "release_41", folder / "current");
  const std::string link = (folder / "current").string();
  const std::string id = id_in({link}, link + "/hall.ply");
  EXPECT_EQ(id, id_in({"/data/current"}, "/data/current/hall.ply"));
  EXPECT_NE(id, id_in({"/data/release_41"}, "/data/release_41/hall.ply"));
}

TEST(SceneIds, ProceduralScenesHaveNamesAloneWhileTheyAreOneOfAKind) {
  const auto id_of = [](const std::vector<std::string>& specs, const std::string& spec,
                        const std::string& name) { return SceneIds(specs, {}).id_of(spec, name); };
  EXPECT_EQ(id_of({"synth:city:1000", "synth:garden:1000"}, "synth:city:1000", "city"), "city");
  const std::vector<std::string> two = {"synth:city:1000", "synth:city:1000:7"};
  const std::string first = id_of(two, two[0], "city"), second = id_of(two, two[1], "city");
  EXPECT_EQ(name_in(first), "city");
  EXPECT_TRUE(belongs_to_path(first) && belongs_to_path(second));
  EXPECT_NE(first, second);
}

TEST(SceneIds, AreFitForLinksWhateverFilesAreCalled) {
  std::set<std::string> ids;
  for (int i = 0; i < 1000; ++i) {
    const std::string name = std::string(120, 'x') + std::to_string(i);
    const std::string id = id_in({"/data"}, "/data/" + name + ".ply", name);
    EXPECT_TRUE(is_scene_id(id)) << id;
    EXPECT_TRUE(ids.insert(id).second) << "long names that begin alike: " << id;
  }
  for (const std::string name : {"", "..", "a\nb", "caf\xe9", "a\x1b[31m"})
    EXPECT_TRUE(is_scene_id(id_in({"/data"}, "/data/" + name + ".ply", name))) << name;
}

}  // namespace
}  // namespace catgs::test
