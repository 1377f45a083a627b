// Scenes of a real library get trees, and are drawn from them.
#include "server/scenes/scene_trees.h"

#include <sys/stat.h>

#include "render_core/math/look_at.h"
#include "render_core/scene/tree/tree_shape.h"
#include "tests/server/scenes/scene_trees_fixture.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

TEST_F(SceneTreesTest, ASceneIsServedAtOnceAndThenFromItsTree) {
  start();
  Entry seen = visit("a");
  EXPECT_FALSE(seen->in_pages);
  EXPECT_EQ(library_->newer_representation(*seen), nullptr);
  library_->on_tick(now_);
  EXPECT_THAT(state("a"), HasSubstr("tree")) << "it waits or is built";
  run_until([&] { return entry("a") != seen; });
  const Entry tree = entry("a");
  EXPECT_TRUE(tree->in_pages);
  EXPECT_EQ(tree->facts.gaussians, 3000u);
  EXPECT_EQ(tree->facts.start_pose.position, seen->facts.start_pose.position);
  EXPECT_EQ(tree->facts.title, seen->facts.title);
  EXPECT_EQ(library_->newer_representation(*seen), tree) << "present visitors go on with it";
  EXPECT_EQ(library_->newer_representation(*tree), nullptr);
  EXPECT_THAT(trees(), SizeIs(1));
  EXPECT_EQ(state("a"), "");
  EXPECT_EQ(built(), 1);
  const double with_both = metrics_.scene_bytes.Value();
  seen.reset();
  library_->on_tick(now_);
  EXPECT_LT(metrics_.scene_bytes.Value(), with_both) << "the whole one is left by all";
}

TEST_F(SceneTreesTest, TheNextStartUsesTheTree) {
  start();
  build("a");
  ASSERT_THAT(trees(), SizeIs(1));
  const fs::path tree = trees()[0];
  const std::string bytes = bytes_in(tree);
  start();
  EXPECT_TRUE(visit("a")->in_pages);
  for (int i = 0; i < 10; ++i) library_->on_tick(now_ += 1s);
  EXPECT_EQ(built(), 1);
  EXPECT_THAT(trees(), ElementsAre(tree));
  EXPECT_EQ(bytes_in(tree), bytes);
}

TEST_F(SceneTreesTest, AScenesOwnNameAndSidecarCountInItsTree) {
  write("scenes/a.json", R"({"title": "The hall", "near": 0.5})");
  start();
  build("a");
  start();
  const Entry tree = visit("a");
  EXPECT_TRUE(tree->in_pages);
  EXPECT_EQ(tree->name, "a");
  EXPECT_EQ(tree->facts.title, "The hall");
  EXPECT_EQ(tree->facts.near_z, 0.5f);
  EXPECT_EQ(tree->sidecar, folder_ / "scenes/a.json");
}

TEST_F(SceneTreesTest, AChangedSceneGetsAnotherTree) {
  start();
  build("a");
  const fs::path before = trees().at(0);
  replace("scenes/a.ply", 2000);
  now_ += 31s;
  run_until([&] { return !fs::exists(before); });
  run_until([&] { return !entry("a"); });
  EXPECT_EQ(visit("a")->facts.gaussians, 2000u);
  build("a");
  EXPECT_EQ(entry("a")->facts.gaussians, 2000u);
  EXPECT_THAT(trees(), SizeIs(1));
  EXPECT_EQ(built(), 2);
}

TEST_F(SceneTreesTest, TreeOfReplacedFilesDoesNotStay) {
  start();
  build("a");
  start();
  const auto wait_for_loader = [&] {
    std::promise<void> idle;
    Background::Jobs jobs(background_);
    jobs.start(lanes.scenes, Priority::low, [&](const auto&) { idle.set_value(); });
    idle.get_future().wait();
  };
  replace("scenes/a.ply", 2000);
  library_->on_tick(now_ += 31s);
  wait_for_loader();  // the scan has seen the new file, and nobody knows it yet
  EXPECT_TRUE(awaited("a"));
  wait_for_loader();
  run_until([&] {
    const auto answer = library_->want(id("a"), now_);
    return std::holds_alternative<Entry>(answer) &&
           std::get<Entry>(answer)->facts.gaussians == 2000;
  });
}

TEST_F(SceneTreesTest, ADamagedTreeIsBuiltAgain) {
  start();
  build("a");
  const fs::path tree = trees().at(0);
  const std::string bytes = bytes_in(tree);
  const auto damaged = [&](std::size_t at) {
    std::string copy = bytes;
    copy[at] = static_cast<char>(copy[at] ^ 1);
    return copy;
  };
  for (const std::string& broken : {std::string(), damaged(100), damaged(5000),  // in a page
                                    bytes.substr(0, bytes.size() - 1)}) {
    library_.reset();
    std::ofstream(tree, std::ios::binary) << broken;
    start();
    EXPECT_FALSE(visit("a")->in_pages) << "it is served as a whole meanwhile";
  }
  run_until([&] { return entry("a")->in_pages; });
  EXPECT_EQ(bytes_in(tree), bytes);
}

TEST_F(SceneTreesTest, DamageThatIsFoundLaterIsMended) {
  save_scene(random_cloud(30'000, 3), folder_ / "scenes/b.ply");
  config_.scene_memory_mb = 6;  // memory for four pages of nine
  start();
  const Entry seen = visit("b");
  const fs::path tree = trees().at(0);
  const std::string bytes = bytes_in(tree);
  std::fstream file(tree, std::ios::in | std::ios::out | std::ios::binary);
  const TreeShape shape(30'000, 3);
  for (std::uint64_t page = 1; page < shape.pages(); ++page) {
    file.seekp(static_cast<std::streamoff>(shape.page_offset(page) + 200));
    file.put(static_cast<char>(bytes[shape.page_offset(page) + 200] ^ 1));
  }
  file.close();
  const auto view = seen->renderer->make_view({});
  for (const float x : {-8.0f, 8.0f}) {
    FrameRequest request;
    request.camera = make_camera(look_at({x, 0, 0}, {0, 0, 0}, {0, -1, 0}), {64, 48}, 60.0f);
    request.waits_for_pages = true;
    FrameView frame;
    ASSERT_TRUE(view->render(request, frame).ok());
  }
  ASSERT_GT(seen->renderer->pages().at(0).unreadable, 0u);
  run_until([&] { return entry("b") != seen; });
  EXPECT_EQ(built(), 2);
  EXPECT_EQ(bytes_in(tree), bytes);
  EXPECT_EQ(library_->newer_representation(*seen), entry("b")) << "present visitors go on with it";
  for (int i = 0; i < 10; ++i) library_->on_tick(now_ += 1s);
  EXPECT_THAT(trees(), ElementsAre(tree)) << "the new one is not that with the damage";
}

/// Opening one would wait for its reader, and a server that ends would wait for the build.
TEST_F(SceneTreesTest, PipesAndLinksInPlaceOfATreeAreReplaced) {
  start();
  build("a");
  const fs::path tree = trees().at(0);
  library_.reset();
  for (const fs::path& name : {tree, fs::path(tree.string() + ".part")}) {
    fs::remove(name);
    ASSERT_EQ(::mkfifo(name.c_str(), 0600), 0);
  }
  start();
  build("a");
  EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(tree)));
  library_.reset();
  write("secret", "of somebody");
  fs::remove(tree);
  fs::create_symlink(folder_ / "secret", tree);
  start();
  build("a");
  EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(tree)));
  EXPECT_EQ(bytes_in(folder_ / "secret"), "of somebody");
}

TEST_F(SceneTreesTest, ASceneThatDoesNotFitWaitsForItsTree) {
  save_scene(random_cloud(30'000, 3), folder_ / "scenes/b.ply");  // 7.1 MB
  config_.scene_memory_mb = 6;
  start();
  EXPECT_TRUE(awaited("b"));
  library_->on_tick(now_);
  EXPECT_THAT(state("b"), HasSubstr("tree")) << "it waits or is built";
  const Entry tree = visit("b");
  EXPECT_TRUE(tree->in_pages);
  EXPECT_EQ(tree->facts.gaussians, 30'000u);
  EXPECT_LE(metrics_.scene_bytes.Value(), 6e6);
  config_.cache_dir.clear();
  start();
  const auto answer = library_->want(id("b"), now_);
  ASSERT_TRUE(std::holds_alternative<ErrorMessage>(answer));
  EXPECT_THAT(std::get<ErrorMessage>(answer).message, HasSubstr("more than --scene-memory allows"));
}

TEST_F(SceneTreesTest, OneTreeIsBuiltAtATime) {
  for (const char* name : {"b", "c", "d"})
    save_scene(random_cloud(30'000, 3), folder_ / "scenes" / (std::string(name) + ".ply"));
  config_.scene_memory_mb = 6;
  start();
  for (const char* name : {"b", "c", "d", "c"}) EXPECT_TRUE(awaited(name));
  library_->on_tick(now_);
  run_until([&] {
    const std::vector<std::string> states = {state("b"), state("c"), state("d")};
    const auto builds = [](const std::string& state) { return state.starts_with("building"); };
    EXPECT_LE(std::ranges::count_if(states, builds), 1);
    for (const std::size_t i : {0, 1})
      EXPECT_FALSE(!states[i].empty() && states[i + 1].empty()) << "the order of their requests";
    return built() == 3;
  });
}

TEST_F(SceneTreesTest, OneOfTheSettingsIsReadyWhenTheServerIs) {
  save_scene(random_cloud(30'000, 3), folder_ / "hall.ply");
  config_.scenes = {folder_ / "hall.ply"};
  config_.scene_memory_mb = 6;
  start();
  EXPECT_TRUE(entry("hall")->in_pages) << "it does not fit: its tree is built first";
  EXPECT_EQ(built(), 1);
  start();
  EXPECT_TRUE(entry("hall")->in_pages);
  EXPECT_EQ(built(), 1);
  config_.scene_memory_mb = 0;
  library_.reset();
  fs::remove_all(folder_ / "trees");
  start();
  const Entry whole = entry("hall");
  EXPECT_FALSE(whole->in_pages);
  run_until([&] { return entry("hall")->in_pages; });
  EXPECT_EQ(library_->newer_representation(*whole), entry("hall"));
}

TEST_F(SceneTreesTest, TheNextVisitorGetsTheTreeWhereBothFormsDoNotFit) {
  save_scene(random_cloud(30'000, 3), folder_ / "scenes/b.ply");
  config_.scene_memory_mb = 8;
  start();
  Entry whole = visit("b");
  EXPECT_FALSE(whole->in_pages);
  run_until([&] { return built() == 1; });
  for (int i = 0; i < 10; ++i) library_->on_tick(now_);
  EXPECT_EQ(entry("b"), whole) << "somebody looks at it";
  whole.reset();
  run_until([&] { return !entry("b"); });
  EXPECT_TRUE(visit("b")->in_pages);
}

TEST_F(SceneTreesTest, SmallScenesGetNone) {
  config_.gaussians_of_a_tree = 3001;
  start();
  visit("a");
  for (int i = 0; i < 10; ++i) library_->on_tick(now_ += 1s);
  EXPECT_EQ(state("a"), "");
  EXPECT_THAT(trees(), IsEmpty());
}

TEST_F(SceneTreesTest, NothingIsWrittenUnlessConfigured) {
  config_.cache_dir.clear();
  start();
  visit("a");
  for (int i = 0; i < 10; ++i) library_->on_tick(now_ += 1s);
  EXPECT_EQ(state("a"), "");
  std::vector<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder_.path()))
    names.push_back(entry.path().filename());
  EXPECT_THAT(names, UnorderedElementsAre("scenes", "a.ply"));
}

// Whatever of the scene is in memory then.
TEST_F(SceneTreesTest, FirstViewIsKeptForTheNextStart) {
  start();
  visit("a");
  library_.reset();
  const fs::path view = kept(".view").at(0);
  const std::string bytes = bytes_in(view);
  const std::size_t doubtful = bytes.rfind('\n', bytes.size() - 2);  // the last line
  write("trees/" + view.filename().string(),
        bytes.substr(0, bytes.rfind('\n', doubtful - 1) + 1) + "77" + bytes.substr(doubtful));
  start();
  EXPECT_EQ(visit("a")->facts.scale, 77.0f);
  build("a");
  EXPECT_EQ(entry("a")->facts.scale, 77.0f) << "drawn from its tree";
}

TEST_F(SceneTreesTest, PosterIsKeptForTheNextStart) {
  config_.gaussians_of_a_tree = 3001;  // posters from a tree differ a little
  const auto poster_of_next_start = [&] {
    start();
    std::shared_ptr<const std::string> poster;
    run_until([&] {
      library_->want_poster(id("a"));
      const auto listing = library_->listing();
      poster = std::ranges::find(*listing, id("a"), &SceneLibrary::Listing::id)->poster;
      return poster != nullptr;
    });
    return *poster;
  };
  const std::string made = poster_of_next_start();
  const fs::path file = kept(".jpg").at(0);
  EXPECT_EQ(bytes_in(file), made);
  const std::string other =
      "\xff\xd8"
      "another"
      "\xff\xd9";
  std::ofstream(file, std::ios::binary) << other;
  EXPECT_EQ(poster_of_next_start(), other);
  EXPECT_EQ(entry("a"), nullptr) << "nothing is loaded for it";
  std::ofstream(file, std::ios::binary) << made.substr(0, 1000);
  EXPECT_EQ(poster_of_next_start(), made) << "one that is damaged is made again";
  std::ofstream(file, std::ios::binary) << other;
  write("scenes/a.json", R"({"background": "#ffffff"})");
  EXPECT_NE(poster_of_next_start(), other) << "the author shows something else now";
  for (const fs::path& poster : kept(".jpg")) std::ofstream(poster, std::ios::binary) << other;
  EXPECT_EQ(poster_of_next_start(), other);
  config_.up = "x";
  EXPECT_NE(poster_of_next_start(), other) << "visits begin elsewhere now";
  for (const fs::path& poster : kept(".jpg")) std::ofstream(poster, std::ios::binary) << other;
  start();
  EXPECT_EQ(*visit("a")->poster, other) << "a visitor's load draws none";
}

TEST_F(SceneTreesTest, AFailedBuildIsNotTriedAgainSoon) {
  // In the place of the tree.
  write("trees/" + tree_name(locate_scene(folder_ / "scenes/a.ply"), {}) + "/file", "");
  start();
  const Entry whole = visit("a");
  run_until([&] { return failed() == 1; });
  for (int i = 0; i < 10; ++i) library_->on_tick(now_ += 1min);
  EXPECT_EQ(state("a"), "");
  EXPECT_EQ(entry("a"), whole);
  EXPECT_EQ(failed(), 1);
  now_ += 30min;
  run_until([&] { return failed() == 2; });
}

TEST_F(SceneTreesTest, ASceneThatChangesWhileItIsBuiltGetsNoTreeOfIt) {
  start();
  touch("scenes/a.ply");  // as by a copy that goes on
  visit("a");
  run_until([&] { return failed() == 1; });
  EXPECT_THAT(trees(), IsEmpty());
}

TEST_F(SceneTreesTest, AnEndingServerLeavesNoHalfTree) {
  save_scene(random_cloud(100'000, 3), folder_ / "scenes/large.ply");
  start();
  visit("large");
  library_->on_tick(now_);
  library_.reset();
  for (const fs::path& tree : trees()) EXPECT_EQ(tree.extension(), ".tree");
}

TEST_F(SceneTreesTest, ASaveDuringTheBuildIsKept) {
  start();
  const Entry seen = visit("a");
  run_until([&] { return entry("a") != seen; });
  auto saved = std::make_shared<SceneEntry>(*seen);
  saved->facts.title = "Saved";
  library_->revise(id("a"), saved);
  EXPECT_EQ(entry("a")->facts.title, "Saved");
  EXPECT_TRUE(entry("a")->in_pages);
}

TEST_F(SceneTreesTest, PosterOfASavedViewStaysWhenTheTreeComes) {
  start();
  const Entry seen = visit("a");
  const auto save = [&](const SceneEntry& entry, const char* poster) {
    auto saved = std::make_shared<SceneEntry>(entry);
    saved->facts.start_pose.position = {0, 0, -9};
    saved->poster = std::make_shared<const std::string>(poster);
    library_->revise(id("a"), saved);
  };
  run_until([&] { return built() == 1; });
  save(*seen, "before");
  run_until([&] { return entry("a")->in_pages; });
  EXPECT_TRUE(*entry("a")->poster == "before") << "the tree's shows the view before";
  save(*seen, "after");
  EXPECT_TRUE(*entry("a")->poster == "after") << "it was drawn meanwhile";
}

}  // namespace
}  // namespace catgs::test
