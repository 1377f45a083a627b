#include "server/scenes/derived_files.h"

#include <fmt/format.h>

#include "render_core/scene/files/save_scene.h"
#include "server/scenes/kept_views.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_encoder.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

namespace fs = std::filesystem;

class DerivedFilesTest : public FolderTest {
 protected:
  std::string name_of(const std::string& scene, const LoadOptions& levels = {}) {
    return tree_name(locate_scene(folder_ / scene), levels);
  }
  void age(const fs::path& file, std::chrono::hours by) {
    fs::last_write_time(file, fs::last_write_time(file) - by);
  }
  fs::path tree(const std::string& name) { return write("trees/" + name, "a tree"); }

  const fs::path trees_ = folder_ / "trees";
};

TEST_F(DerivedFilesTest, NamesFollowTheContentOfAScene) {
  save_scene(random_cloud(10, 0), folder_ / "a hall.ply");
  const std::string name = name_of("a hall.ply");
  EXPECT_THAT(name, MatchesRegex("a-hall-[0-9a-f]+-[0-9a-f]+\\.tree"));
  EXPECT_EQ(name_of("a hall.ply"), name);
  write("a hall.json", R"({"title": "A sidecar does not count"})");
  EXPECT_EQ(name_of("a hall.ply"), name);
  write("a hall.json", R"({"title": "Its model counts", "model": "antialiased"})");
  EXPECT_NE(name_of("a hall.ply"), name);
  write("a hall.json", "{}");
  LoadOptions coarse;
  coarse.lod = 1;
  EXPECT_NE(name_of("a hall.ply", coarse), name);
  age(folder_ / "a hall.ply", 1h);
  EXPECT_NE(name_of("a hall.ply"), name) << "another time";
}

TEST_F(DerivedFilesTest, FirstViewsAreKeptWhateverIsLoaded) {
  save_scene(random_cloud(10, 0), folder_ / "a.ply");
  const SceneLocation scene = locate_scene(folder_ / "a.ply");
  const DerivedFiles files(trees_);
  ServerConfig config;
  int estimates = 0;
  const auto kept = [&] {
    return keep_view(&files, scene, config)([&] {
      SceneHints hints;
      hints.scale = 0.1f + static_cast<float>(++estimates);
      hints.up = {0.6f, 0.0f, 0.8f};
      hints.start_pose.position = {1e9f, -1.0f / 3.0f, 1e-9f};
      hints.limits.max = {7, 8, 9};
      hints.up_is_doubtful = true;
      return hints;
    });
  };
  const SceneHints first = kept();
  config.lod = 3;
  config.scene_memory_mb = 1;
  write("a.json", R"({"title": "It tells no up"})");
  const SceneHints again = kept();
  EXPECT_EQ(estimates, 1);
  EXPECT_EQ(again.scale, first.scale);
  EXPECT_EQ(again.up, first.up);
  EXPECT_EQ(again.start_pose.position, first.start_pose.position);
  EXPECT_EQ(again.limits.max, first.limits.max);
  EXPECT_TRUE(again.up_is_doubtful);
  EXPECT_EQ(again.source, "estimated");
  for (const auto& entry : fs::directory_iterator(trees_))
    if (entry.path().extension() == ".view") fs::resize_file(entry.path(), 40);
  kept();
  EXPECT_EQ(estimates, 2) << "it was damaged";
  config.up = "+z";
  kept();
  write("a.json", R"({"up": "+y"})");
  kept();
  age(folder_ / "a.ply", 1h);
  kept();
  EXPECT_EQ(estimates, 5) << "other facts";
}

TEST_F(DerivedFilesTest, NamesFollowAllFilesOfAFolderButItsSidecar) {
  for (const auto& [file, content] : encode_sog(random_cloud(40, 0), 2))
    write("sog/" + file, content);
  const std::string name = name_of("sog");
  write("sog/scene.json", "{}");
  EXPECT_EQ(name_of("sog"), name);
  write("sog/deeper/0.webp", "pixels");
  EXPECT_NE(name_of("sog"), name);
}

TEST_F(DerivedFilesTest, NamesFollowTheDataBesideAGltfAndAllTilesets) {
  GltfParts parts = encode_gltf(random_cloud(10, 0));
  parts.json["buffers"][0]["uri"] = "a.bin";
  write("a.gltf", parts.json.dump());
  write("a.bin", parts.binary);
  const std::string gltf = name_of("a.gltf");
  age(folder_ / "a.gltf", 1h);
  EXPECT_EQ(name_of("a.gltf"), gltf) << "the data is newer";
  age(folder_ / "a.bin", 2h);
  EXPECT_NE(name_of("a.gltf"), gltf);

  write("tiles/tileset.json", "{}");
  write("tiles/more/0.json", "{}");
  const std::string tiles = name_of("tiles");
  write("tiles/more/0.json", "{ }");
  EXPECT_NE(name_of("tiles"), tiles);
}

TEST_F(DerivedFilesTest, RemovesWhatKilledBuildsHaveLeftAndNothingElse) {
  const std::string whole = "hall-3f0c91d2-9b1deb4d3b7d4bad.tree";
  tree(whole);
  tree(whole + ".part");
  tree(whole + ".x9Yb2c");
  const std::string new_file = "." + whole + ".3f0c91d29b1deb4d.new";
  tree(new_file);
  const std::string former = "0123456789abcdef-0123456789abcdef0123456789abcdef.walk";
  tree(former);
  for (const char* other : {"hall.tree", "hall.tree.part", "hall-9b1deb4d3b7d4bad.tree.part",
                            "hall-3f0c91d2-9b1deb4d3b7d4bad.ply", "a.walk", "notes"})
    tree(other);
  const DerivedFiles cache(trees_);
  EXPECT_TRUE(cache.contains(whole));
  EXPECT_TRUE(fs::exists(trees_ / whole));
  EXPECT_FALSE(fs::exists(trees_ / (whole + ".part")));
  EXPECT_FALSE(fs::exists(trees_ / (whole + ".x9Yb2c")));
  EXPECT_FALSE(fs::exists(trees_ / new_file));
  EXPECT_FALSE(fs::exists(trees_ / former)) << "earlier versions named it so";
  for (const char* other : {"hall.tree", "hall.tree.part", "hall-9b1deb4d3b7d4bad.tree.part",
                            "hall-3f0c91d2-9b1deb4d3b7d4bad.ply", "a.walk", "notes"}) {
    EXPECT_TRUE(fs::exists(trees_ / other)) << other;
    EXPECT_FALSE(cache.contains(other)) << other;
  }
}

TEST_F(DerivedFilesTest, MakesItsFolderAndNamesTheSettingWhereThatFails) {
  EXPECT_FALSE(fs::exists(trees_));
  { const DerivedFiles cache(trees_ / "deeper"); }
  EXPECT_TRUE(fs::is_directory(trees_ / "deeper"));
  const fs::path file = write("file", "no folder");
  EXPECT_THAT(input_error([&] { DerivedFiles cache(file); }),
              HasSubstr("--cache-dir " + file.string()));
  EXPECT_THAT(input_error([&] { DerivedFiles cache(file / "below"); }), HasSubstr("--cache-dir"));
}

TEST_F(DerivedFilesTest, AFolderServesOneServerAtATime) {
  {
    const DerivedFiles cache(trees_);
    EXPECT_THAT(input_error([&] { DerivedFiles other(trees_); }), HasSubstr("another server"));
  }
  const DerivedFiles next(trees_);
}

TEST_F(DerivedFilesTest, KeepsTheTreesOfPresentScenes) {
  const std::string present = "hall-3f0c91d2-9b1deb4d3b7d4bad.tree";
  const std::string changed = "hall-3f0c91d2-0000000000000000.tree";
  const std::string absent = "barn-00000000-0000000000000001.tree";
  for (const std::string& name : {present, changed, absent}) tree(name);
  DerivedFiles cache(trees_);
  age(trees_ / present, 24h * 30);
  age(trees_ / absent, 24h * 6);
  cache.keep({present});
  EXPECT_TRUE(cache.contains(present));
  EXPECT_FALSE(cache.contains(changed)) << "the scene has another content now";
  EXPECT_FALSE(fs::exists(trees_ / changed));
  EXPECT_TRUE(cache.contains(absent)) << "its folder may come back";
  age(trees_ / absent, 24h * 2);
  cache.keep({});
  EXPECT_TRUE(cache.contains(present)) << "it was seen a moment ago";
  EXPECT_FALSE(cache.contains(absent));
  EXPECT_FALSE(fs::exists(trees_ / absent));
}

TEST_F(DerivedFilesTest, SmallFileIsReadAgain) {
  const DerivedFiles cache(trees_);
  const std::string name = "hall-3f0c91d2-9b1deb4d3b7d4bad.walk";
  const auto any = [](const ByteSource&) {};
  EXPECT_EQ(cache.read(name, 100, any), std::nullopt);
  cache.write(name, "steps", 1);
  EXPECT_EQ(cache.read(name, 100, any), "steps");
}

TEST_F(DerivedFilesTest, DamagedSmallFileIsRemoved) {
  const DerivedFiles cache(trees_);
  const fs::path file = tree("hall-3f0c91d2-9b1deb4d3b7d4bad.walk");
  EXPECT_EQ(
      cache.read(file.filename(), 100,
                 [](const ByteSource& bytes) { throw InputError(bytes.name(), {}, "is bad"); }),
      std::nullopt);
  EXPECT_FALSE(fs::exists(file));
  tree(file.filename());
  EXPECT_EQ(cache.read(file.filename(), 3, [](const ByteSource&) {}), std::nullopt) << "too large";
  EXPECT_FALSE(fs::exists(file));
}

TEST_F(DerivedFilesTest, SmallFilesThatWereUsedLastStay) {
  const DerivedFiles cache(trees_);
  const auto name = [](int i) { return fmt::format("hall-{:08x}-{:016x}.walk", i, i); };
  constexpr int others = 300;
  for (int i = 0; i < others; ++i) age(tree(name(i)), std::chrono::hours(others - i));
  const fs::path whole = tree("hall-3f0c91d2-9b1deb4d3b7d4bad.tree");
  age(whole, 1000h);
  constexpr int most = 250;
  cache.write(name(others), "", most);
  constexpr int gone = others + 1 - most;
  EXPECT_FALSE(fs::exists(trees_ / name(gone - 1)));
  EXPECT_TRUE(fs::exists(trees_ / name(gone)));
  EXPECT_TRUE(fs::exists(whole)) << "trees count apart";
}

TEST_F(DerivedFilesTest, SmallFilesOfOneSceneDropNoneOfOthers) {
  const DerivedFiles cache(trees_);
  const fs::path other = tree("barn-00000000-0000000000000001.walk");
  age(other, 1h);
  const auto name = [](std::size_t i) { return fmt::format("hall-00000001-{:016x}.walk", i); };
  constexpr std::size_t kept = DerivedFiles::most_small_files_of_scene;
  for (std::size_t i = 0; i < 2 * kept; ++i) {
    cache.write(name(i), "", 3 * kept);
    age(trees_ / name(i), std::chrono::hours(2 * kept - i));
  }
  EXPECT_FALSE(fs::exists(trees_ / name(kept - 1)));
  EXPECT_TRUE(fs::exists(trees_ / name(kept)));
  EXPECT_TRUE(fs::exists(other));
}

}  // namespace
}  // namespace catgs::test
