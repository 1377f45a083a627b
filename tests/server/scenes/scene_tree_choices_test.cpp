// Scenes are drawn from their trees or without, whatever looks better in the memory that there is.
#include <future>

#include <nlohmann/json.hpp>

#include "render_core/scene/edit/edit_scene.h"
#include "render_core/scene/files/hints.h"
#include "render_core/scene/tree/page_pools.h"
#include "render_core/synth/synth.h"
#include "server/scenes/scene_catalog.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/server/scenes/scene_trees_fixture.h"
#include "tests/support/captured_log.h"
#include "tests/support/rendered.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

/// A scene of levels, the finest first, of which that of 30,000 Gaussians takes 7.1 MB.
class SceneLevelsTest : public SceneTreesTest {
 protected:
  void write_levels(const std::vector<GaussianCloud>& levels) {
    nlohmann::json lods, files;
    for (std::size_t level = 0; level < levels.size(); ++level) {
      const std::string folder = std::to_string(level);
      for (const auto& [file, content] : encode_sog(levels[level], 2))
        write("scenes/streamed/" + folder + "/" + file, content);
      lods[folder] = {{"file", level}, {"offset", 0}, {"count", levels[level].size()}};
      files.push_back(folder + "/meta.json");
    }
    write("scenes/streamed/lod-meta.json", nlohmann::json{{"version", 1},
                                                          {"lodLevels", levels.size()},
                                                          {"filenames", files},
                                                          {"tree", {{"lods", lods}}}}
                                               .dump());
  }
  /// Returns what was kept of the only comparison; empty: nothing.
  [[nodiscard]] std::string choice() const {
    const auto files = kept(".choice");
    return files.empty() ? "" : bytes_in(files[0]);
  }
  /// As if the cache were of a server that compared nothing.
  void forget_choice() const {
    for (const fs::path& file : kept(".choice")) fs::remove(file);
  }
};

TEST_F(SceneLevelsTest, AStreamedSceneThatDoesNotFitBeginsWithACoarserLevel) {
  write_levels({random_cloud(30'000, 0), random_cloud(1'000, 0)});
  config_.scene_memory_mb = 6;
  start();
  const Entry coarse = visit("streamed");
  EXPECT_EQ(coarse->facts.gaussians, 1'000u);
  EXPECT_FALSE(coarse->in_pages);
  run_until([&] { return library_->newer_representation(*coarse) != nullptr; });
  const Entry tree = library_->newer_representation(*coarse);
  EXPECT_EQ(tree->facts.gaussians, 30'000u);
  EXPECT_TRUE(tree->in_pages);
}

/// Dots on a wall, of which small parts of a picture show few pages.
GaussianCloud wall(std::size_t dots, std::uint32_t seed) {
  GaussianCloud cloud = random_cloud(dots, 0, seed);
  std::ranges::fill(cloud.scale, glm::vec3(0.08f));
  for (glm::vec3& mean : cloud.mean) mean = {4.0f * mean.x, 4.0f * mean.y, 5.0f};
  return cloud;
}

/// The wall of `seen` dots, and 29 for each of them that are as good as invisible, until they are
/// merged.
GaussianCloud hidden_wall(const GaussianCloud& seen) {
  GaussianCloud all = wall(30 * seen.size(), 5);
  std::ranges::fill(all.opacity, 0.004f);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    all.mean[30 * i] = seen.mean[i];
    all.opacity[30 * i] = seen.opacity[i];
    all.sh[30 * i] = seen.sh[i];
  }
  return all;
}

constexpr const char* before_wall =
    R"({"up": [0, -1, 0], "start_pose": {"position": [0, 0, -5], "orientation": [0, 0, 0, 1]}})";

TEST_F(SceneLevelsTest, LevelsThatLookBetterInThisMemoryAreDrawn) {
  const GaussianCloud coarse = wall(2'000, 1);
  write_levels({hidden_wall(coarse), coarse});
  write("scenes/streamed.json", before_wall);
  config_.scene_memory_mb = 12;  // memory for 6 pages of 16
  start();
  const Entry levels = visit("streamed");
  EXPECT_EQ(levels->facts.gaussians, 2'000u);
  run_until([&] { return !choice().empty(); });
  ASSERT_EQ(choice(), "without\n");
  for (int i = 0; i < 10; ++i) library_->on_tick(now_ += 1s);
  EXPECT_EQ(entry("streamed"), levels);
  EXPECT_EQ(built(), 1);
  start();
  EXPECT_FALSE(visit("streamed")->in_pages) << "the answer is kept";
}

TEST_F(SceneLevelsTest, CachedTreeIsComparedOnce) {
  save_scene(hidden_wall(wall(2'000, 1)), folder_ / "scenes/wall.ply");
  write("scenes/wall.json", before_wall);
  config_.scene_memory_mb = 8;  // for the wall, 3.4 MB, and 4 pages of 16
  for (const auto& [name, better] : {std::pair{"a", "tree\n"}, std::pair{"wall", "without\n"}}) {
    SCOPED_TRACE(name);
    start();
    visit(name);
    run_until([&] { return !choice().empty(); });
    EXPECT_EQ(choice(), better);
    library_.reset();
    forget_choice();
    start();
    EXPECT_TRUE(visit(name)->in_pages) << "as long as nothing is known";
    run_until([&] { return !choice().empty(); });
    EXPECT_EQ(choice(), better);
    EXPECT_EQ(entry(name)->in_pages, choice() == "tree\n");
    const CapturedLog log;
    start();
    EXPECT_EQ(visit(name)->in_pages, choice() == "tree\n");
    for (int i = 0; i < 10; ++i) library_->on_tick(now_ += 1s);
    library_.reset();  // which waits for its jobs
    EXPECT_THAT(log.text(), Not(HasSubstr("pictures have")));
    forget_choice();
  }
}

TEST_F(SceneLevelsTest, ComparisonGivesWayToVisitors) {
  save_scene(random_cloud(500, 0), folder_ / "scenes/b.ply");
  start();
  visit("a");
  std::promise<void> go;
  Background::Jobs others(background_);
  others.start(lanes.scenes, Priority::high, [&](const auto&) { go.get_future().wait(); });
  run_until([&] { return built() == 1; });
  library_->on_tick(now_);
  EXPECT_TRUE(awaited("b"));
  go.set_value();
  run_until([&] { return in_memory("b"); });
  EXPECT_EQ(choice(), "");
  now_ += 1min;
  run_until([&] { return entry("a")->in_pages; });
  EXPECT_EQ(choice(), "tree\n");
}

/// Levels that cannot be compared with the tree.
TEST_F(SceneLevelsTest, TreeIsDrawnUntilTheNextStartWhereNothingCanBeCompared) {
  const auto at = [](float x, std::size_t gaussians) {
    GaussianCloud cloud = random_cloud(gaussians, 0);
    for (glm::vec3& mean : cloud.mean) mean.x += x;
    return cloud;
  };
  struct Case {
    std::string why;
    std::vector<GaussianCloud> levels;  // the tree's origin is that of the last
    bool damaged = false;
  };
  const Case cases[] = {{"damaged or cut off", {at(0, 30'000), at(0, 1'000)}, true},
                        {"another origin", {at(2000, 30'000), at(2000, 1'000), at(2500, 100)}}};
  fs::remove(folder_ / "scenes/a.ply");
  config_.scenes.clear();
  config_.scene_memory_mb = 6;  // for a level and the pages
  for (const Case& of : cases) {
    SCOPED_TRACE(of.why);
    library_.reset();
    fs::remove_all(folder_ / "scenes/streamed");
    write_levels(of.levels);
    const double built_before = built();
    start();
    EXPECT_EQ(visit("streamed")->facts.gaussians, 1'000u);
    run_until([&] { return built() > built_before; });
    library_.reset();
    forget_choice();
    if (of.damaged)
      for (const auto& image : fs::directory_iterator(folder_ / "scenes/streamed/1")) {
        if (image.path().extension() != ".webp") continue;
        const auto time = fs::last_write_time(image);
        std::string bytes = bytes_in(image);
        std::fill(bytes.begin() + 25, bytes.end(), '\xff');  // behind its size in pixels
        std::ofstream(image.path(), std::ios::binary) << bytes;
        fs::last_write_time(image, time);
      }
    for (const char* which : {"first", "next"}) {
      SCOPED_TRACE(which);
      const CapturedLog log;
      start();
      EXPECT_TRUE(visit("streamed")->in_pages);
      run_until([&] { return log.text().find("compared with nothing") != std::string::npos; });
      for (int i = 0; i < 10; ++i) library_->on_tick(now_ += 1s);
      EXPECT_TRUE(entry("streamed")->in_pages);
      library_.reset();  // which waits for its jobs
      const std::string text = log.text();
      EXPECT_THAT(text, HasSubstr(of.why));
      std::size_t loads = 0;
      for (std::size_t i = text.find("loading "); i != std::string::npos;
           i = text.find("loading ", i + 1))
        ++loads;
      EXPECT_EQ(loads, 2u) << "its tree, and once its levels";
      EXPECT_EQ(choice(), "");
    }
  }
}

TEST_F(SceneTreesTest, PosterIsWantedAgainWhereTheTreeWasLostMeanwhile) {
  save_scene(random_cloud(30'000, 3), folder_ / "scenes/b.ply");  // 7.1 MB
  config_.scene_memory_mb = 6;
  start();
  visit("b");
  library_.reset();
  for (const fs::path& poster : kept(".jpg")) fs::remove(poster);
  const fs::path tree = trees().at(0);
  std::fstream(tree, std::ios::in | std::ios::out | std::ios::binary).seekp(5000).put('\xff');
  ticks_ = false;
  start();
  std::promise<void> go;
  Background::Jobs others(background_);
  others.start(lanes.scenes, Priority::high, [&](const auto&) { go.get_future().wait(); });
  library_->want_poster(id("b"));
  io_->poll();
  EXPECT_TRUE(awaited("b")) << "a visitor's load finds the damage first";
  go.set_value();
  run_until([&] { return !fs::exists(tree); });
  EXPECT_TRUE(awaited("b"));
  run_until([&] { return built() == 2; });
  run_until([&] {
    library_->want_poster(id("b"));
    return listed("b").poster != nullptr;
  });
}

/// The picture that visits begin with.
Rendered first_sight(Renderer& renderer, const SceneFacts& facts) {
  constexpr glm::ivec2 size_px{320, 180};
  FrameRequest request;
  request.camera =
      make_camera(facts.start_pose, size_px, focal_from_fov_y(1.0472f, size_px.y), facts.near_z);
  request.detail_px = static_cast<float>(ServerConfig().detail_px);
  request.waits_for_pages = true;
  const auto view = renderer.make_view({Pipeline::exact, PixelFormat::rgb_f32});
  Rendered picture = render_in(*view, request);
  EXPECT_TRUE(picture.stats.settled);
  EXPECT_EQ(picture.stats.missing_pages, 0u);
  return picture;
}

TEST_F(SceneLevelsTest, CityInASmallPoolLooksNoWorseThanItsLevels) {
  const auto pool = std::make_shared<ThreadPool>(2);
  Scene city = synthesize(SynthKind::city, 300'000, 1);
  GaussianCloud& all = city.cloud;
  for (std::size_t i = 0; i < all.size(); ++i) all.sh[i] = all.sh_of(i)[0];
  all.resize(all.size(), 0);  // 17 MB
  std::vector<GaussianCloud> levels(3, all);
  edit_cloud(levels[1], {.merge_to = 60'000}, *pool, LoadContext(*pool));
  edit_cloud(levels[2], {.merge_to = 20'000}, *pool, LoadContext(*pool));
  write_levels(levels);
  write_sidecar(city.hints, folder_ / "scenes/streamed.json");
  config_.scene_memory_mb = 32;  // a pool of 16 MB
  start();
  visit("streamed");
  run_until([&] { return !choice().empty(); });
  const Entry shown = entry("streamed");

  const SceneLocation location = locate_scene(folder_ / "scenes/streamed");
  std::vector<float> right;
  double best_db = 0.0;  // of the levels that fit
  for (int level = 0; level < 3; ++level) {
    LoadOptions options;
    options.lod = level;
    const auto cloud = std::make_shared<const GaussianCloud>(load_scene(location, options).cloud);
    const auto made = make_renderer(cloud, {RendererKind::cpu, pool});
    const std::vector<float> picture = first_sight(*made.renderer, shown->facts).rgb;
    if (level == 0) right = picture;
    if (cloud->bytes() <= tree_memory(config_))
      best_db = std::max(best_db, psnr_db(picture, right));
  }
  EXPECT_GE(psnr_db(first_sight(*shown->renderer, shown->facts).rgb, right), best_db - 0.1);
  // Something was to be chosen.
  RendererOptions options{RendererKind::cpu, pool};
  options.pages = std::make_shared<PagePools>(tree_memory(config_));
  const auto tree = make_renderer(open_in_pages(trees().at(0), location, {}).tree, options);
  const double tree_db = psnr_db(first_sight(*tree.renderer, shown->facts).rgb, right);
  EXPECT_LT(tree_db, best_db - 1.0);
}

}  // namespace
}  // namespace catgs::test
