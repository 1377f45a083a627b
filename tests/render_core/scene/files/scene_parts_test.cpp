#include "render_core/scene/files/scene_parts.h"

#include <cmath>
#include <sstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/formats/splat.h"
#include "render_core/scene/keep_if.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_encoder.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/interiors.h"
#include "tests/support/surface_clouds.h"

namespace catgs::test {
namespace {

class ScenePartsTest : public FolderTest {
 protected:
  std::string built(const SceneParts& parts, std::size_t memory_bytes = std::size_t{1} << 30) {
    build_tree(parts, folder_ / "out.tree", memory_bytes, *pool_, LoadContext(*pool_));
    return content_of(folder_ / "out.tree");
  }

  /// Fails unless the tree of the scene's parts is that of the loaded scene.
  void expect_same_tree(const std::filesystem::path& path, std::size_t dropped) {
    const Scene whole = load_scene(path);
    ASSERT_EQ(whole.report.dropped, dropped);
    const auto each = [&](const auto& take) {
      take(whole.cloud);
      return std::uint64_t{whole.report.dropped};
    };
    const std::string bytes = built({each, whole.format, true});
    const auto scene = scene_in_parts(locate_scene(path), {}, pool_, 777);
    ASSERT_TRUE(scene);
    EXPECT_TRUE(built(scene->parts) == bytes) << "read once";
    EXPECT_TRUE(built(scene->parts, 0) == bytes) << "read twice";
  }

  /// Writes a streamed SOG with the levels' SOGs, all of them below one node each.
  std::filesystem::path write_streamed_sog(const std::vector<std::vector<GaussianCloud>>& levels) {
    nlohmann::json meta = {{"lodLevels", levels.size()}, {"filenames", nlohmann::json::array()}};
    for (std::size_t level = 0; level < levels.size(); ++level)
      for (std::size_t i = 0; i < levels[level].size(); ++i) {
        const GaussianCloud& cloud = levels[level][i];
        const std::string name = std::to_string(level) + "_" + std::to_string(i);
        for (const auto& [file, content] : encode_sog(cloud, 2))
          write("streamed/" + name + "/" + file, content);
        meta["tree"]["children"][i]["lods"][std::to_string(level)] = {
            {"file", meta["filenames"].size()}, {"offset", 0}, {"count", cloud.size()}};
        meta["filenames"].push_back(name + "/meta.json");
      }
    return write("streamed/lod-meta.json", meta.dump()).parent_path();
  }

  const std::shared_ptr<ThreadPool> pool_ = std::make_shared<ThreadPool>(2);
};

/// Every `stride`-th Gaussian, as large as those that it stands for.
GaussianCloud coarser(const GaussianCloud& cloud, std::size_t stride) {
  GaussianCloud part = cloud;
  keep_if(part, [&](std::size_t i) { return i % stride == 0; });
  for (glm::vec3& scale : part.scale) scale *= std::sqrt(static_cast<float>(stride));
  return part;
}

LoadOptions chosen(std::optional<int> lod, std::optional<std::size_t> budget = std::nullopt) {
  LoadOptions options;
  options.lod = lod;
  options.gaussian_budget = budget;
  return options;
}

void expect_same_view(const SceneHints& one, const SceneHints& other, float tolerance) {
  EXPECT_LE(glm::distance(one.up, other.up), tolerance);
  EXPECT_LE(glm::distance(one.start_pose.position, other.start_pose.position), tolerance);
  EXPECT_LE(angle_between(one.start_pose.orientation, other.start_pose.orientation), tolerance);
  EXPECT_LE(glm::distance(one.focus, other.focus), tolerance);
  EXPECT_LE(glm::distance(one.limits.min, other.limits.min), tolerance);
  EXPECT_LE(glm::distance(one.limits.max, other.limits.max), tolerance);
  EXPECT_LE(std::abs(one.scale - other.scale), tolerance);
}

// Its halves have levels of their own, so that a budget chooses finer ones for one half first.
TEST_F(ScenePartsTest, TheFirstViewIsTheSameWhateverIsLoaded) {
  const GaussianCloud whole = flat(60000);
  std::vector<std::vector<GaussianCloud>> levels;
  for (const std::size_t stride : {1, 3, 9}) {
    levels.push_back({coarser(whole, stride), coarser(whole, stride)});
    keep_if(levels.back()[0],
            [&, all = levels.back()[0]](std::size_t i) { return all.mean[i].x < 5; });
    keep_if(levels.back()[1],
            [&, all = levels.back()[1]](std::size_t i) { return all.mean[i].x >= 5; });
  }
  const SceneLocation location = locate_scene(write_streamed_sog(levels));
  const SceneHints finest = load_scene(location).hints;
  EXPECT_GT(finest.up.z, 0.999f);
  for (const int lod : {0, 1, 2})
    expect_same_view(load_scene(location, chosen(lod)).hints, finest, 0);
  for (const std::size_t budget : {7'000, 15'000, 30'000, 45'000}) {
    const Scene scene = load_scene(location, chosen(std::nullopt, budget));
    ASSERT_LE(scene.cloud.size(), budget);
    expect_same_view(scene.hints, finest, 0);
  }
  const auto parted = scene_in_parts(location, {}, pool_);
  expect_same_view(parted->hints, finest, 0);
  const auto tree = folder_ / "a.tree";
  build_tree(parted->parts, tree, 1'000'000, *pool_, LoadContext(*pool_));
  expect_same_view(open_in_pages(tree, location, {}).outline.hints, finest, 0);
  const SceneHints paged = open_in_pages(locate_scene(tree)).outline.hints;
  expect_same_view(load_scene(tree).hints, paged, 0);
  EXPECT_GT(paged.up.z, 0.999f);
}

TEST_F(ScenePartsTest, AMissingLevelKeepsNoOtherFromBeingSeen) {
  const GaussianCloud whole = flat(20000);
  const std::filesystem::path folder = write_streamed_sog({{whole}, {coarser(whole, 4)}});
  std::filesystem::remove_all(folder / "0_0");
  const Scene scene = load_scene(folder, chosen(1));
  EXPECT_GT(scene.hints.up.z, 0.99f);
  EXPECT_THAT(scene.notes, ::testing::ElementsAre(::testing::HasSubstr("0_0")));
}

TEST_F(ScenePartsTest, AFileInPartsHasTheFirstViewOfTheLoadedScene) {
  const auto path = write("a.ply", ply_bytes(hall(70000)));
  const auto parted = scene_in_parts(locate_scene(path), {}, pool_, 9999);
  expect_same_view(parted->hints, load_scene(path).hints, 0);
}

TEST_F(ScenePartsTest, AKeptViewIsNotEstimatedAgain) {
  const auto path = write("a.ply", ply_bytes(ball(1.0f)));
  SceneHints kept;
  kept.scale = 77.0f;
  LoadOptions options;
  options.keep_view = [&](const auto&) { return kept; };
  EXPECT_EQ(load_scene(path, options).hints.scale, 77.0f);
  EXPECT_EQ(scene_in_parts(locate_scene(path), options, pool_)->hints.scale, 77.0f);
}

TEST_F(ScenePartsTest, ATreeKeepsTheModel) {
  GaussianCloud cloud = random_cloud(2000, 0);
  for (glm::vec3& scale : cloud.scale) scale = {0.2f, 0.3f, 0.25f};
  for (const SplatModel model : {SplatModel::antialiased, SplatModel::surfels}) {
    cloud.model = model;
    const auto path = write("a.ply", ply_bytes(cloud)), out = folder_ / "a.tree";
    build_tree(scene_in_parts(locate_scene(path), {}, pool_, 777)->parts, out, 1'000'000, *pool_,
               LoadContext(*pool_));
    const GaussianCloud read = load_scene(out).cloud;
    EXPECT_EQ(read.model, model);
    const float thickness = model == SplatModel::surfels ? 2e-4f : 0.2f;  // not made flat twice
    for (const glm::vec3& scale : read.scale)
      ASSERT_NEAR(std::min({scale.x, scale.y, scale.z}), thickness, 0.5f * thickness);
    EXPECT_EQ(open_in_pages(locate_scene(out)).tree->model(), model);
  }
  LoadOptions options;
  options.model = SplatModel::antialiased;
  EXPECT_EQ(open_in_pages(locate_scene(folder_ / "a.tree"), options).tree->model(),
            SplatModel::antialiased);
}

TEST_F(ScenePartsTest, PartsHaveTheGaussiansOfTheLoadedScene) {
  GaussianCloud cloud = random_cloud(5000, 1);
  for (std::size_t i = 0; i < cloud.size(); i += 7) cloud.mean[i].x = NAN;
  for (std::size_t i = 0; i < cloud.size(); i += 11) cloud.opacity[i] = 1e-4f;
  cloud.mean[4000].y = 3e7f;  // absurd beside the others
  const auto path = write("a.ply", ply_bytes(cloud));
  write("a.json", R"({"near": 0.125})");
  const Scene whole = load_scene(path);
  ASSERT_EQ(whole.report.absurd, 1u);

  const auto scene = scene_in_parts(locate_scene(path), {}, pool_, 777);
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
TEST_F(ScenePartsTest, AbsurdGaussiansAreJudgedByASample) {
  GaussianCloud cloud = random_cloud(100'000, 0);
  cloud.mean[77'777].z = -2e8f;
  const auto path = write("a.ply", ply_bytes(cloud));
  std::size_t taken = 0;
  const std::uint64_t dropped =
      scene_in_parts(locate_scene(path), {}, pool_)->parts.each([&](const GaussianCloud& part) {
        taken += part.size();
      });
  EXPECT_EQ(dropped, 1u);
  EXPECT_EQ(taken, load_scene(path).cloud.size());
}

TEST_F(ScenePartsTest, ASplatGivesTheTreeOfTheLoadedScene) {
  GaussianCloud cloud = random_cloud(5000, 0);
  for (std::size_t i = 0; i < cloud.size(); i += 10) cloud.opacity[i] = 1e-4f;
  cloud.mean[4001].y = 3e7f;  // absurd
  std::ostringstream bytes;
  write_splat(cloud, bytes);
  expect_same_tree(write("a.splat", bytes.str()), 501);
}

TEST_F(ScenePartsTest, AStreamedSogGivesTheTreeOfTheLoadedScene) {
  GaussianCloud fine = random_cloud(1500, 2, 1);
  for (std::size_t i = 0; i < fine.size(); i += 10) fine.opacity[i] = 1e-4f;
  expect_same_tree(write_streamed_sog({{fine, random_cloud(700, 1, 2), random_cloud(300, 0, 3)},
                                       {random_cloud(90, 1, 4), random_cloud(80, 0, 5)}}),
                   150);
}

TEST_F(ScenePartsTest, TilesGiveTheTreeOfTheLoadedScene) {
  GaussianCloud fine = random_cloud(1500, 2, 1);
  for (std::size_t i = 0; i < fine.size(); i += 10) fine.opacity[i] = 1e-4f;
  write("tiles/coarse.glb", encode_gltf(random_cloud(300, 0, 3)).glb());
  write("tiles/fine.glb", encode_gltf(fine).glb());
  write("tiles/rest.glb", encode_gltf(random_cloud(700, 0, 2)).glb());
  write("tiles/tileset.json", R"({"asset": {"version": "1.1"}, "root": {"refine": "REPLACE",
    "content": {"uri": "coarse.glb"}, "children": [{"content": {"uri": "fine.glb"}},
    {"content": {"uri": "rest.glb"}}]}})");
  expect_same_tree(folder_ / "tiles", 150);
}

TEST_F(ScenePartsTest, AStreamedSogInAnArchiveGivesTheTreeOfItsFolder) {
  const auto folder = write_streamed_sog({{random_cloud(900, 1, 2)}, {random_cloud(90, 0, 5)}});
  expect_same_tree(write("a.ssog", zip(files_below(folder))), 0);
}

TEST_F(ScenePartsTest, NotesTellWhatIsLeftOut) {
  GaussianCloud cloud = random_cloud(300, 3);
  std::string bytes = ply_bytes(cloud);
  // Harmonics of degree 4: 27 properties more, before those of the opacity.
  std::string more;
  for (int k = 45; k < 72; ++k) more += fmt::format("property float f_rest_{}\n", k);
  const std::size_t header_end = bytes.find("end_header\n") + 11;
  const std::size_t row = (bytes.size() - header_end) / cloud.size();
  std::string wider = bytes.substr(0, bytes.find("end_header")) + more + "end_header\n";
  for (std::size_t i = 0; i < cloud.size(); ++i)
    wider += bytes.substr(header_end + i * row, row) + std::string(27 * 4, '\0');
  const auto path = write("a.ply", wider);
  EXPECT_EQ(load_scene(path).notes, notes_of_degree(4));
  EXPECT_EQ(scene_in_parts(locate_scene(path), {}, pool_)->notes, notes_of_degree(4));
}

TEST_F(ScenePartsTest, OtherFormatsHaveNoParts) {
  const GaussianCloud cloud = random_cloud(300, 0);
  for (const auto& path :
       {write("a.spz", encode_spz(cloud, {.version = 3})),
        write("b.splat", encode_spz(cloud, {.version = 3})),
        write("c.sog", zip(encode_sog(cloud, 2))),
        write("d.ply", encode_compressed_ply(cloud, false)), write_streamed_sog({{cloud}})})
    EXPECT_FALSE(scene_in_parts(locate_scene(path), {}, pool_)) << path;
}

TEST_F(ScenePartsTest, AFileThatIsCutOffIsRefused) {
  std::string bytes = ply_bytes(random_cloud(300, 0));
  bytes.resize(bytes.size() - 1);
  const auto path = write("a.ply", bytes);
  EXPECT_EQ(refusal_of([&] { scene_in_parts(locate_scene(path), {}, pool_); }),
            (Refusal{path.string(), fmt::format("byte {}", bytes.size())}));
  const auto splat = write("b.splat", "x");
  EXPECT_EQ(refusal_of([&] { scene_in_parts(locate_scene(splat), {}, pool_); }),
            (Refusal{splat.string(), "byte 1"}));
}

}  // namespace
}  // namespace catgs::test
