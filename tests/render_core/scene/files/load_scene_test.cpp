#include "render_core/scene/files/load_scene.h"

#include <algorithm>
#include <vector>

#include <sys/stat.h>

#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/files/save_scene.h"
#include "render_core/scene/files/scene_parts.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/ply.h"
#include "render_core/scene/prune.h"
#include "render_core/scene/scene.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/surface_clouds.h"

namespace catgs::test {
namespace {

class LoadScene : public FolderTest {
 protected:
  [[nodiscard]] std::ptrdiff_t files() const {
    return std::distance(std::filesystem::directory_iterator(folder_.path()),
                         std::filesystem::directory_iterator());
  }
};

TEST_F(LoadScene, SavedScenesAreLoaded) {
  const GaussianCloud cloud = random_cloud(5000, 3);
  save_scene(cloud, folder_ / "room.ply");
  std::vector<double> progress;
  LoadOptions options;
  options.progress = [&](double fraction) { progress.push_back(fraction); };
  const Scene scene = load_scene(folder_ / "room.ply", options);
  EXPECT_EQ(scene.name, "room");
  EXPECT_EQ(scene.cloud.mean, cloud.mean);
  EXPECT_EQ(scene.cloud.sh, cloud.sh);
  EXPECT_EQ(scene.report.read, 5000u);
  EXPECT_EQ(scene.hints.source, "estimated");
  ASSERT_FALSE(progress.empty());
  EXPECT_TRUE(std::is_sorted(progress.begin(), progress.end()));
  EXPECT_EQ(progress.back(), 1.0);
  EXPECT_EQ(files(), 1) << "and none that it became";
}

TEST_F(LoadScene, AFirstViewThatNobodyWantsIsLeftOutUnlessAFileTellsIt) {
  save_scene(random_cloud(1000, 0), folder_ / "room.ply");
  LoadOptions options;
  options.first_view = false;
  EXPECT_EQ(load_scene(folder_ / "room.ply", options).hints.source, "");
  write("room.json", R"({"near": 0.125})");
  EXPECT_EQ(load_scene(folder_ / "room.ply", options).hints.near_z, 0.125f);
}

TEST_F(LoadScene, NerfstudiosCommentMakesZTheUsualUp) {
  std::string bytes = ply_bytes(ball(1.0f));
  bytes.insert(bytes.find("element vertex"), "comment Vertical Axis: z\n");
  write("ball.ply", bytes);
  EXPECT_EQ(load_scene(folder_ / "ball.ply").hints.up, glm::vec3(0, 0, 1));
  const auto pool = std::make_shared<ThreadPool>(2);
  EXPECT_EQ(scene_in_parts(locate_scene(folder_ / "ball.ply"), {}, pool)->hints.up,
            glm::vec3(0, 0, 1));
}

TEST_F(LoadScene, TheModelIsThatOfTheOptionElseTheSidecarElseTheFile) {
  GaussianCloud cloud = random_cloud(1000, 0);
  cloud.model = SplatModel::antialiased;
  for (const char* name : {"room.ply", "room.spz"}) {
    SCOPED_TRACE(name);
    std::filesystem::remove(folder_ / "room.json");
    const auto path = folder_ / name;
    save_scene(cloud, path);
    EXPECT_EQ(load_scene(path).cloud.model, SplatModel::antialiased);
    write("room.json", R"({"model": "2dgs"})");
    const Scene discs = load_scene(path);
    EXPECT_EQ(discs.cloud.model, SplatModel::surfels);
    EXPECT_LT(discs.cloud.scale[0].z, 0.002f * discs.cloud.scale[0].x);
    EXPECT_THAT(discs.notes, testing::Contains(testing::HasSubstr("flat Gaussians")));
    LoadOptions options;
    options.model = SplatModel::standard;
    EXPECT_EQ(load_scene(path, options).cloud.model, SplatModel::standard);
  }
}

TEST_F(LoadScene, AnOrbitInAnSpzCounts) {
  const GaussianCloud cloud = random_cloud(1000, 0);
  const SpzStyle style{.version = 4, .orbit = OrbitLimits{0.1f, 0.5f, 50.0f}};
  const Scene scene = load_scene(write("room.spz", encode_spz(cloud, style)));
  EXPECT_GE(glm::distance(scene.hints.start_pose.position, scene.hints.focus), 49.9f);
}

TEST_F(LoadScene, AFileThatIsCutOffWhileItIsReadIsRefused) {
  const auto cut_off_at_the_first_piece = [&](const std::filesystem::path& path) {
    LoadOptions options;
    options.threads = 1;
    options.progress = [&](double) { std::filesystem::resize_file(path, 1000); };
    return refusal_of([&] { load_scene(path, options); });
  };
  const GaussianCloud cloud = random_cloud(200'000, 0);
  for (const auto& path : {folder_ / "room.ply", folder_ / "room.splat"}) {
    save_scene(cloud, path);
    const Refusal refusal = cut_off_at_the_first_piece(path);
    EXPECT_EQ(refusal.source, path.string());
    EXPECT_THAT(refusal.where, ::testing::StartsWith("byte "));
  }
}

TEST_F(LoadScene, NamesAreUtf8WhateverTheFileIsCalled) {
  save_scene(random_cloud(10, 0), folder_ / "caf\xe9\xff.ply");
  EXPECT_EQ(load_scene(folder_ / "caf\xe9\xff.ply").name, "caf\ufffd\ufffd");
  save_scene(random_cloud(10, 0), folder_ / "caf\u00e9 \"1\".ply");
  EXPECT_EQ(load_scene(folder_ / "caf\u00e9 \"1\".ply").name, "caf\u00e9 \"1\"");
}

TEST_F(LoadScene, FilesAreToldApartByContent) {
  const GaussianCloud cloud = random_cloud(300, 1);
  const auto format_of = [&](const std::string& name, const std::string& content) {
    const Scene scene = load_scene(write(name, content));
    EXPECT_EQ(scene.cloud.size(), 300u) << name;
    return scene.format;
  };
  EXPECT_EQ(format_of("a.bin", ply_bytes(cloud)), "3DGS ply");
  EXPECT_EQ(format_of("b.ply", encode_compressed_ply(cloud, true)), "compressed ply");
  for (const int version : {1, 2, 3, 4})
    EXPECT_EQ(format_of("c.ply", encode_spz(cloud, {.version = version})),
              "spz v" + std::to_string(version));
  EXPECT_EQ(format_of("d.ply", zip(encode_sog(cloud, 1))), "sog v1 (zip)");
  EXPECT_EQ(format_of("e.sog", zip(encode_sog(cloud, 2))), "sog v2 (zip)");
  save_scene(cloud, folder_ / "f.splat");
  EXPECT_EQ(load_scene(folder_ / "f.splat").format, "splat");
  save_scene(cloud, folder_ / "g.spz");
  EXPECT_EQ(load_scene(folder_ / "g.spz").format, "spz v3");
}

TEST_F(LoadScene, HarmonicsThatAreCutOffAreTold) {
  const GaussianCloud cloud = random_cloud(300, 3);
  const auto notes_of = [&](const SpzStyle& style) {
    return load_scene(write("a.spz", encode_spz(cloud, style))).notes;
  };
  const std::string told = notes_of_degree(4)[0];
  EXPECT_THAT(notes_of({}), testing::Not(testing::Contains(told)));
  EXPECT_THAT(notes_of({.extra_sh_degree = 4}), testing::Contains(told));
}

TEST_F(LoadScene, FoldersAreRecognisedByWhatTheyHold) {
  const GaussianCloud cloud = random_cloud(300, 1);
  for (const auto& [name, content] : encode_sog(cloud, 2)) write("museum/" + name, content);
  for (const char* path : {"museum", "museum/", "museum/meta.json"}) {
    const Scene scene = load_scene(folder_ / path);
    EXPECT_EQ(scene.format, "sog v2 (folder)");
    EXPECT_EQ(scene.name, "museum");
  }
  write("single/only.ply", ply_bytes(cloud));
  write("single/readme.txt", "");
  EXPECT_EQ(load_scene(folder_ / "single").name, "only");
  write("single/second.splat", "");
  EXPECT_EQ(input_error([&] { load_scene(folder_ / "single"); }),
            (folder_ / "single").string() +
                ": holds 2 scenes: only.ply, second.splat (name one of them)");
  write("empty/readme.txt", "");
  EXPECT_EQ(refusal_of([&] { load_scene(folder_ / "empty"); }),
            (Refusal{(folder_ / "empty").string(), ""}));
}

TEST_F(LoadScene, TrainingOutputGivesTheNewestIterationAndItsCameras) {
  const auto ply = [&](const std::string& iteration, std::size_t count) {
    write("garden/point_cloud/iteration_" + iteration + "/point_cloud.ply",
          ply_bytes(random_cloud(count, 0)));
  };
  ply("7000", 70);
  ply("30000", 300);
  ply("best", 9);
  std::filesystem::create_directories(folder_ / "garden/point_cloud/iteration_40000");
  write("garden/cameras.json", R"([{"position": [0, 0, -9],
        "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}])");
  for (const char* path : {"garden", "garden/point_cloud/iteration_30000/point_cloud.ply"}) {
    const Scene scene = load_scene(folder_ / path);
    EXPECT_EQ(scene.name, "garden");
    EXPECT_EQ(scene.cloud.size(), 300u);
    EXPECT_EQ(scene.hints.source, "cameras.json");
    EXPECT_EQ(scene.hints.start_pose.position, glm::vec3(0, 0, -9));
  }
  write("garden.json", R"({"near": 0.125})");
  EXPECT_EQ(load_scene(folder_ / "garden").hints.near_z, 0.125f);
}

TEST_F(LoadScene, SidecarsAreFoundBesideFilesAndFolders) {
  write("room.ply", ply_bytes(random_cloud(30, 0)));
  write("room.json", R"({"up": "+z"})");
  EXPECT_EQ(load_scene(folder_ / "room.ply").hints.source, "sidecar room.json");
  for (const auto& [name, content] : encode_sog(random_cloud(300, 0), 2))
    write("museum/" + name, content);
  write("museum.json", R"({"up": "+z"})");
  EXPECT_EQ(load_scene(folder_ / "museum").hints.up, glm::vec3(0, 0, 1));
}

TEST_F(LoadScene, UnknownFilesAreRefusedWithTheListOfFormats) {
  const auto path = write("notes.txt", "no scene");
  EXPECT_EQ(
      input_error([&] { load_scene(path); }),
      path.string() +
          ": is not a scene of a known format (supported: .ply (3DGS or compressed), .ssog, .sog, "
          ".spz, .glb, .gltf, .lcc2, .lcc, .tree, .ksplat, .splat, a folder with lod-meta.json "
          "(streamed "
          "SOG), tileset.json (3D Tiles) or meta.json (SOG), a training output folder)");
  LoadOptions level;
  level.lod = 1;
  write("level.ply", ply_bytes(random_cloud(3, 0)));
  write("empty.ply", "");
  for (const char* name : {"empty.ply", "absent.ply", "level.ply"})
    EXPECT_EQ(refusal_of([&] { load_scene(folder_ / name, level); }),
              (Refusal{(folder_ / name).string(), ""}));
  EXPECT_EQ(
      input_error([&] { load_scene("synth:city:300000"); }),
      "synth:city:300000: does not exist (catgs-render synth city OUT.ply makes such a scene)");
}

TEST_F(LoadScene, EachFormatIsToldByItsExtensionToo) {
  for (const char* name : {"a.ply", "a.splat", "a.ksplat", "a.spz", "a.sog", "a.ssog", "a.glb",
                           "a.gltf", "a.lcc", "a.lcc2", "a.tree"})
    EXPECT_TRUE(is_scene_name(name)) << name;
  for (const char* name : {"a.json", "ply", "a.obj", ".ply"}) EXPECT_FALSE(is_scene_name(name));
  for (const char* name : {"lod-meta.json", "tileset.json", "meta.json"})
    EXPECT_TRUE(is_scene_index(folder_ / name)) << name;
  EXPECT_FALSE(is_scene_index("room.json"));
}

TEST_F(LoadScene, NamedPipesDoNotHang) {
  ASSERT_EQ(::mkfifo((folder_ / "pipe.ply").c_str(), 0600), 0);
  EXPECT_EQ(refusal_of([&] { load_scene(folder_ / "pipe.ply"); }),
            (Refusal{(folder_ / "pipe.ply").string(), ""}));
}

TEST_F(LoadScene, CloudsWithNothingToDrawAreRefused) {
  GaussianCloud cloud = random_cloud(30, 0);
  for (float& opacity : cloud.opacity) opacity = 1e-4f;
  EXPECT_EQ(refusal_of([&] { load_scene(write("a.ply", ply_bytes(cloud))); }),
            (Refusal{(folder_ / "a.ply").string(), ""}));
}

TEST_F(LoadScene, SavingNamesUnknownExtensionsAndMissingFolders) {
  const GaussianCloud cloud = random_cloud(3, 0);
  EXPECT_EQ(input_error([&] { save_scene(cloud, "a.obj"); }),
            "a.obj: cannot be written: unknown extension '.obj' (use .ply, .sog, .spz, .glb, .tree "
            "or .splat)");
  for (const char* name : {"a.gltf", "a.ssog", "a.compressed.ply", "no/a.ply"})
    EXPECT_EQ(refusal_of([&] { save_scene(cloud, folder_ / name); }).source,
              (folder_ / name).string());
}

TEST_F(LoadScene, FailedSavingLeavesNothingBehind) {
  GaussianCloud cloud = random_cloud(3, 0);
  cloud.mean[0].x = 1e20f;  // .spz cannot hold it
  write("a.spz", "older");
  EXPECT_EQ(refusal_of([&] { save_scene(cloud, folder_ / "a.spz"); }).source,
            (folder_ / "a.spz").string());
  EXPECT_EQ(std::filesystem::file_size(folder_ / "a.spz"), 5u);
  EXPECT_EQ(files(), 1);
}

TEST(Prune, MostImportantGaussiansStayInOrder) {
  GaussianCloud cloud = random_cloud(5, 1);
  for (std::size_t i = 0; i < 5; ++i) {
    cloud.opacity[i] = 0.5f;
    cloud.scale[i] = glm::vec3(0.1f);
  }
  cloud.scale[1] = glm::vec3(0.1f, 0.1f, 1e-6f);  // flat: one of three shadows is left
  cloud.opacity[3] = 0.1f;                        // weaker still
  cloud.opacity[4] = 0.9f;
  const GaussianCloud before = cloud;
  keep_most_important(cloud, 1.0);
  EXPECT_EQ(cloud.size(), 5u);
  keep_most_important(cloud, 0.79);
  EXPECT_EQ(cloud.mean,
            (std::vector{before.mean[0], before.mean[1], before.mean[2], before.mean[4]}));
  keep_most_important(cloud, 0.5);
  EXPECT_EQ(cloud.mean, (std::vector{before.mean[0], before.mean[4]}));  // ties: the first stays
  EXPECT_EQ(cloud.sh_of(1)[3], before.sh_of(4)[3]);
  EXPECT_EQ(cloud.sh.size(), 8u);
}

TEST(FormatLimits, NotesAreFewAndShort) {
  std::vector<std::string> notes;
  for (int i = 0; i < 100; ++i) add_note(notes, std::string(1000, 'x') + std::to_string(i));
  EXPECT_EQ(notes.size(), 1u) << "cut, they are the same";
  for (int i = 0; i < 100; ++i) add_note(notes, std::to_string(i));
  EXPECT_EQ(notes.size(), 32u);
  EXPECT_LE(notes[0].size(), 323u);
  add_note(notes = {}, "\x1b[31m\xff");
  EXPECT_THAT(notes, testing::ElementsAre("\\x1b[31m\\xff"));
}

TEST(FormatLimits, LimitsAreThoseOfTheSecurityPage) {
  const MemorySource file("a.spz", {});
  EXPECT_NO_THROW(require_count(file, "count", 268'435'456));
  const Refusal count{"a.spz", "count"};
  EXPECT_EQ(refusal_of([&] { require_count(file, "count", 268'435'457); }), count);
  EXPECT_NO_THROW(require_plausible_count(file, "count", 1 << 20, 1, (1 << 20) / 256));
  EXPECT_EQ(
      refusal_of([&] { require_plausible_count(file, "count", 1 << 20, 1, (1 << 20) / 256 - 1); }),
      count);
  EXPECT_NO_THROW(require_plausible_count(file, "count", 65'536, 1, 0));
  EXPECT_EQ(refusal_of([&] { require_plausible_count(file, "count", 65'537, 1, 0); }), count);
}

}  // namespace
}  // namespace catgs::test
