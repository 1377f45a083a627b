#include "server/scenes/scene_catalog.h"

#include <nlohmann/json.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/files/save_scene.h"
#include "render_core/scene/tree/page_pools.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/render_core/scene/tree/tree_test_support.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

using ::testing::_;
using ::testing::WhenDynamicCastTo;

/// A streamed SOG folder with levels of 200 and 50 Gaussians, and a splat file without levels.
class SceneCatalog : public FolderTest {
 protected:
  void SetUp() override {
    nlohmann::json lods;
    for (const int level : {0, 1}) {
      const std::size_t count = level == 0 ? 200 : 50;
      const std::string folder = "streamed/" + std::to_string(level);
      for (const auto& [file, content] : encode_sog(random_cloud(count, 0), 2))
        write(folder + "/" + file, content);
      lods[std::to_string(level)] = {{"file", level}, {"offset", 0}, {"count", count}};
    }
    write("streamed/lod-meta.json", nlohmann::json{{"version", 1},
                                                   {"lodLevels", 2},
                                                   {"filenames", {"0/meta.json", "1/meta.json"}},
                                                   {"tree", {{"lods", lods}}}}
                                        .dump());
    save_scene(random_cloud(30, 0), folder_ / "plain.splat");
    config_.scenes = {folder_ / "streamed", folder_ / "plain.splat"};
  }
  std::shared_ptr<const SceneEntry> load(std::size_t scene, const SceneRepresentation& form = {},
                                         const KeepDerived& keep = {}) {
    return load_scene(
        locate_scenes(config_).at(scene), form, [](const std::string& name) { return name; },
        config_,
        {.kind = RendererKind::cpu,
         .pool = std::make_shared<ThreadPool>(2),
         .pages = std::make_shared<PagePools>(tree_memory(config_))},
        2, {}, keep);
  }
  std::uint64_t gaussians(std::size_t scene) { return load(scene)->facts.gaussians; }

  ServerConfig config_;
};

TEST_F(SceneCatalog, ChoosesTheLevelOfStreamedScenesOnly) {
  EXPECT_EQ(gaussians(0), 200u);
  config_.lod = 1;
  EXPECT_EQ(gaussians(0), 50u);
  EXPECT_EQ(gaussians(1), 30u);
}

TEST_F(SceneCatalog, KeepsABudget) {
  config_.gaussian_budget = 199;
  EXPECT_EQ(gaussians(0), 50u);
  config_.gaussian_budget = 200;
  EXPECT_EQ(gaussians(0), 200u);
}

TEST_F(SceneCatalog, RefusesALevelThatNoSceneHas) {
  config_.lod = 2;
  EXPECT_THAT([&] { gaussians(0); }, ThrowsMessage<InputError>(HasSubstr("no level 2")));
  config_.scenes = {folder_ / "plain.splat", "synth:city:1000"};
  EXPECT_THAT([&] { gaussians(0); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("--lod"), HasSubstr("streamed SOG"))));
}

// A tree may have any number of Gaussians: --scene-memory bounds what is in memory of it.
TEST_F(SceneCatalog, ReadsATreeInPages) {
  ThreadPool pool(2);
  write("large.tree", tree_bytes(random_cloud(60'000, 0), pool));
  config_.scenes = {folder_ / "large.tree"};
  config_.scene_memory_mb = 8;
  const auto entry = load(0);
  EXPECT_EQ(entry->facts.gaussians, 60'000u);
  EXPECT_TRUE(entry->in_pages);
  EXPECT_LE(entry->renderer->scene_bytes(), tree_memory(config_));
  EXPECT_LE(tree_memory(config_), 4'000'000u);
  EXPECT_NE(entry->poster, nullptr);
  config_.scenes = {folder_ / "plain.splat"};
  EXPECT_FALSE(load(0)->in_pages);
}

TEST_F(SceneCatalog, SidecarThatIsReplacedDuringTheLoadCountsAsAWhole) {
  const std::string after = R"({"title": "After"})";
  write("plain.json", R"({"title": "Before", "near": 0.5})");
  const auto entry = load(1, {}, {.view = [&](const auto& estimate) {
                            write("plain.json", after);
                            return estimate();
                          }});
  EXPECT_EQ(entry->facts.title, "After");
  EXPECT_NE(entry->facts.near_z, 0.5f);
  EXPECT_EQ(entry->sidecar_tag, etag_of(after));
}

TEST_F(SceneCatalog, ReadsASceneFromATreeOfItsOwn) {
  ThreadPool pool(2);
  const auto tree = write("other.tree", tree_bytes(random_cloud(300, 0), pool));
  const auto entry = load(1, {.tree = tree});
  EXPECT_TRUE(entry->in_pages);
  EXPECT_EQ(entry->facts.gaussians, 300u);
  EXPECT_TRUE(glm::all(glm::lessThan(entry->facts.content_min, entry->facts.content_max)));
  EXPECT_EQ(entry->name, "plain");
  EXPECT_EQ(entry->sidecar, folder_ / "plain.json");
  write("plain.json", R"({"near": -1})");
  EXPECT_THAT([&] { load(1, {.tree = tree}); },
              Throws<InputError>(Not(WhenDynamicCastTo<const UnusableTree&>(_))));
  std::filesystem::remove(folder_ / "plain.json");
  std::filesystem::resize_file(tree, std::filesystem::file_size(tree) - 1);
  EXPECT_THROW(load(1, {.tree = tree}), UnusableTree);
}

TEST_F(SceneCatalog, ReadsTheFinestLevelThatFits) {
  config_.lod = 0;
  const auto entry = load(0, {.most_gaussians = 100});
  EXPECT_EQ(entry->facts.gaussians, 50u);
  EXPECT_TRUE(entry->coarse);
  EXPECT_FALSE(load(0)->coarse);
}

TEST_F(SceneCatalog, NamesASceneThatIsNotThere) {
  const std::string absent = folder_ / "absent.ply";
  config_.scenes = {absent};
  EXPECT_THAT([&] { gaussians(0); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("--scene " + absent), HasSubstr("check"))));
}

}  // namespace
}  // namespace catgs::test
