#include "tests/server/scenes/scene_library_fixture.h"
#include "tests/support/captured_log.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

TEST_F(SceneLibraryTime, ListingsShareWhatPagesGetOfAScene) {
  const auto tours_of_a = [&] { return listed("a").tours; };
  EXPECT_FALSE(tours_of_a());
  const Entry a = load("a");
  EXPECT_EQ(tours_of_a()->for_viewers, a->tours.for_viewers) << "the same, not one like it";
  load("b");
  EXPECT_EQ(tours_of_a()->for_authors, a->tours.for_authors);
}

TEST_F(SceneLibraryTime, APosterStaysWhenItsSceneGoes) {
  library_->want_poster(id("a"));
  run_until([&] { return listed("a").poster != nullptr; });
  load("b");
  EXPECT_NE(listed("b").poster, nullptr);
  tick(60s);
  visit("a");
  tick(60s);
  load("c");
  EXPECT_FALSE(listed("b").loaded);
  EXPECT_NE(listed("b").poster, nullptr);
  touch("b.ply");
  run_until([&] {
    tick(31s);  // an earlier scan may be under way, which has seen the file before
    return listed("b").poster == nullptr;
  });
}

TEST_F(SceneLibraryTime, SavedTitleStaysListedWhenItsSceneGoes) {
  {
    auto saved = std::make_shared<SceneEntry>(*load("a"));
    saved->facts.about.title = "Saved";
    library_->revise(id("a"), std::move(saved));
  }
  load("b");
  tick(60s);
  visit("b");
  load("c");
  EXPECT_FALSE(in_memory("a"));
  EXPECT_EQ(listed("a").title, "Saved");
  save_scene(random_cloud(10, 0), folder_ / "d.ply");
  run_until([&] {
    tick(31s);
    return has("d");
  });
  EXPECT_EQ(listed("a").title, "Saved") << "the folder was looked at again";
}

TEST_F(SceneLibraryTime, APreparedSceneIsThereWhenItsVisitorComes) {
  library_->prepare(id("a"), now_);
  run_until([&] { return in_memory("a"); });
  EXPECT_TRUE(std::holds_alternative<Entry>(library_->want(id("a"), now_)));
  library_->prepare("nowhere", now_);
}

TEST_F(SceneLibraryTime, PreparingReleasesNoSceneButOneThatWasPrepared) {
  config_.scene_memory_mb = 0;
  start();
  for (const char* name : {"a", "b"}) {
    library_->prepare(id(name), now_);
    run_until([&] { return in_memory(name); });
  }
  library_->prepare(id("c"), now_);
  tick(1s);
  EXPECT_FALSE(in_memory("c")) << "two wait for visitors already";
  tick(30s);
  library_->prepare(id("c"), now_);
  run_until([&] { return in_memory("c"); });
  EXPECT_FALSE(in_memory("a"));
  EXPECT_TRUE(in_memory("b"));
}

TEST_F(SceneLibraryTime, PreparingMakesNoRoom) {
  load("a");
  load("b");
  tick(60s);  // nobody looks at them
  library_->prepare(id("c"), now_);
  tick(1s);
  EXPECT_TRUE(in_memory("a") && in_memory("b"));
  EXPECT_FALSE(in_memory("c"));
  EXPECT_TRUE(awaited("c")) << "a visitor may still ask";
  library_->prepare(id("c"), now_);
  run_until([&] { return in_memory("c"); });
}

TEST_F(SceneLibraryTime, NobodyWaitsForAPoster) {
  const auto has_poster = [&](const char* name) { return listed(name).poster != nullptr; };
  EXPECT_TRUE(awaited("a"));
  library_->want_poster(id("b"));  // while a visitor waits
  run_until([&] { return in_memory("a"); });
  EXPECT_FALSE(has_poster("b"));
  library_->want_poster(id("b"));
  library_->want_poster(id("c"));  // one at a time
  run_until([&] { return has_poster("b"); });
  EXPECT_FALSE(has_poster("c"));
  const Entry seen = visit("b");
  library_->want_poster(id("c"));  // there is no room for it
  EXPECT_TRUE(awaited("c")) << "a visitor may still ask";
  EXPECT_TRUE(in_memory("a") && in_memory("b"));
}

TEST_F(SceneLibraryTime, SceneThatWasLoadedForItsPosterIsThereForItsVisitor) {
  library_->want_poster(id("a"));
  run_until([&] { return listed("a").poster != nullptr; });
  EXPECT_TRUE(std::holds_alternative<Entry>(library_->want(id("a"), now_)));
  EXPECT_EQ(metrics_.scenes_loaded.Value(), 1);
}

TEST_F(SceneLibraryTime, VisitorJoinsTheLoadForAPoster) {
  const CapturedLog log;
  const std::string loading = "loading " + (folder_ / "a.ply").string();
  library_->want_poster(id("a"));
  run_until([&] { return log.text().find(loading) != std::string::npos; });
  EXPECT_TRUE(awaited("a") || in_memory("a"));
  visit("a");
  EXPECT_EQ(log.text().find(loading), log.text().rfind(loading)) << "it is loaded once";
}

TEST_F(SceneLibraryTime, ScenesThatWereLoadedForPostersLeaveForOthers) {
  const auto show = [&](const char* name) {
    library_->want_poster(id(name));
    run_until([&] { return listed(name).poster != nullptr; });
  };
  const Entry seen = load("a");
  show("b");
  show("c");
  EXPECT_TRUE(in_memory("c"));
  EXPECT_FALSE(in_memory("b")) << "there is room for one beside that of a visitor";
  library_->prepare(id("b"), now_);
  run_until([&] { return in_memory("b"); });
  EXPECT_FALSE(in_memory("c"));
  config_.scene_memory_mb = 0;
  start();
  for (const char* name : {"a", "b", "c"}) show(name);
  EXPECT_TRUE(in_memory("b") && in_memory("c"));
  EXPECT_FALSE(in_memory("a")) << "two at most stay";
}

TEST_F(SceneLibraryTime, TellsOfScenesBeforeTheyAreLoaded) {
  folder_.write("d.json", R"({"title": "The hall", "licence": "MIT"})");
  save_scene(random_cloud(10, 0), folder_ / "d.ply");
  start();
  EXPECT_EQ(listed("d").title, "The hall");
  EXPECT_EQ(listed("d").about.licence, "MIT");
  EXPECT_FALSE(listed("d").loaded);
}

TEST_F(SceneLibraryTime, ASceneInUseIsNeverReleased) {
  Entry seen = load("a");
  const Entry also_seen = load("b");
  tick(3600s);
  const ErrorMessage refused = refusal("c");
  EXPECT_EQ(refused.code, ErrorCode::server_full);
  EXPECT_THAT(refused.message, HasSubstr("no memory for \"c\""));
  tick(3600s);
  EXPECT_TRUE(in_memory("a") && in_memory("b"));
  seen.reset();
  EXPECT_TRUE(awaited("c"));
  tick(1s);
  EXPECT_FALSE(in_memory("a"));
  EXPECT_TRUE(in_memory("b"));
}

TEST_F(SceneLibraryTime, AReplacedFileIsLoadedAnewWhenNobodyLooksAtTheOldOne) {
  Entry old = load("a");
  replace("a.ply", 100);
  tick(31s);
  run_until([&] { return library_->listing()->at(1).gaussians == 100; });
  tick(1s);
  EXPECT_EQ(entry("a"), old);
  old.reset();
  tick(1s);
  EXPECT_FALSE(in_memory("a"));
  EXPECT_EQ(load("a")->facts.gaussians, 100u);
}

TEST_F(SceneLibraryTime, AMountThatHangsHoldsUpNobodyElse) {
  std::promise<void> mount;
  load("b");
  load("a");
  hang_when_released("a", mount);
  tick(3600s);
  library_->want(id("b"), now_);
  EXPECT_TRUE(awaited("c"));
  tick(1s);
  EXPECT_FALSE(in_memory("a"));
  for (int hour = 0; hour < 3; ++hour) {
    tick(3600s);
    EXPECT_TRUE(std::holds_alternative<Entry>(library_->want(id("b"), now_)));
    EXPECT_TRUE(awaited("c")) << "who asked for it waits";
    EXPECT_THAT(names(), ElementsAre("city", "a", "b", "c"));
  }
  EXPECT_TRUE(awaited("a"));
  save_scene(random_cloud(5000, 3), folder_ / "d.ply");
  mount.set_value();
  run_until([&] { return in_memory("c"); });
}

TEST_F(SceneLibraryTime, FilesThatComeAndGoAreNoticed) {
  EXPECT_THAT(names(), ElementsAre("city", "a", "b", "c"));
  std::filesystem::rename(folder_ / "b.ply", folder_ / "d.ply");
  tick(31s);
  run_until([&] { return has("d"); });
  EXPECT_THAT(names(), ElementsAre("city", "a", "c", "d"));
  EXPECT_FALSE(has("b"));
  load("d");
}

TEST_F(SceneLibraryTime, AFileThatComesBackWhileItIsLookedAtIsTheSceneThatItWas) {
  Entry seen = load("a");
  std::filesystem::rename(folder_ / "a.ply", folder_ / "hidden");
  rescan(3);
  EXPECT_THAT(names(), ElementsAre("city", "b", "c"));
  tick(1s);
  EXPECT_EQ(visit("a"), seen) << "who looks at it stays";
  std::filesystem::rename(folder_ / "hidden", folder_ / "a.ply");
  rescan(4);
  EXPECT_THAT(names(), ElementsAre("city", "a", "b", "c"));
  seen.reset();
  tick(1s);
  EXPECT_TRUE(in_memory("a")) << "the same file: nothing is outdated";
  std::filesystem::remove(folder_ / "a.ply");
  rescan(3);
  tick(1s);
  EXPECT_FALSE(has("a"));
}

TEST_F(SceneLibraryTime, NewcomersAreNotGivenASceneWhoseFileIsGone) {
  config_.scenes.clear();
  start();
  const Entry seen = entry("a");
  EXPECT_EQ(names().front(), "a");
  std::filesystem::rename(folder_ / "a.ply", folder_ / "hidden");
  rescan(2);
  EXPECT_TRUE(has("a")) << "somebody looks at it";
  EXPECT_EQ(names().front(), "b");
  EXPECT_THAT(names(), ElementsAre("b", "c"));
  std::filesystem::rename(folder_ / "hidden", folder_ / "a.ply");
  rescan(3);
  EXPECT_EQ(names().front(), "a");
}

/// Beside "a" comes another file of its name, and the first one goes.
TEST_F(SceneLibraryTime, TheLogTellsWhichFileAnIdOfASharedNameBelongsTo) {
  const TemporaryFolder annex;
  save_scene(random_cloud(10, 0), annex / "a.ply");
  // Of the same name as `folder_`, so that ids are made of whole paths.
  const std::filesystem::path twin = annex / folder_.path().filename();
  std::filesystem::create_directory(twin);
  const CapturedLog log;
  config_.scene_folders = {folder_.path().string(), annex.path().string(), twin.string()};
  start();
  const SceneIds ids({}, config_.scene_folders);
  for (const auto& file : {folder_ / "a.ply", annex / "a.ply"})
    EXPECT_THAT(log.text(), HasSubstr("scene " + ids.id_of(file.string(), "a") + " is " +
                                      file.string() + ", one of several called \"a\""));
  EXPECT_THAT(log.text(), Not(HasSubstr((folder_ / "b.ply").string() + ", one of several")));
  EXPECT_THAT(log.text(), HasSubstr(twin.string() + " have the same name"));
}

TEST_F(SceneLibraryTime, NoIdComesToMeanAnotherFile) {
  const TemporaryFolder annex;
  config_.scene_folders.push_back(annex.path().string());
  start();
  const std::string first = id("a");
  EXPECT_TRUE(library_->has(first));
  save_scene(random_cloud(10, 0), annex / "a.ply");
  rescan(5);
  const std::string second = SceneIds({}, config_.scene_folders).id_of(annex / "a.ply", "a");
  EXPECT_NE(first, second);
  EXPECT_TRUE(library_->has(first) && library_->has(second));
  EXPECT_FALSE(has("a")) << "which of them?";
  std::filesystem::rename(folder_ / "a.ply", folder_ / "hidden");
  rescan(4);
  EXPECT_FALSE(library_->has(first));
  EXPECT_TRUE(library_->has(second));
  EXPECT_FALSE(has("a")) << "it meant the one that is gone";
  std::filesystem::rename(folder_ / "hidden", folder_ / "a.ply");
  tick(31s);
  run_until([&] { return library_->has(first); });
  start();
  EXPECT_TRUE(library_->has(first) && library_->has(second)) << "and not by the order of scans";
  EXPECT_EQ(load(first)->facts.gaussians, 5000u);
  EXPECT_EQ(load(second)->facts.gaussians, 10u);
}

TEST_F(SceneLibraryTime, AFileThatReplacesTheOnlyOneOfItsNameIsAnotherScene) {
  const std::string first = id("a");
  std::filesystem::remove(folder_ / "a.ply");
  save_scene(random_cloud(10, 0), folder_ / "a.splat");
  tick(31s);
  run_until([&] { return !library_->has(first); });
  EXPECT_THAT(names(), ElementsAre("city", "a", "b", "c"));
  EXPECT_FALSE(has("a")) << "a link that names it may have been made for the first";
  start();
  EXPECT_TRUE(has("a")) << "which a server that never saw the first cannot know";
}

TEST_F(SceneLibraryTime, AFileOfBothSettingsIsOneScene) {
  config_.scenes = {folder_ / "b.ply"};
  start();
  EXPECT_THAT(names(), ElementsAre("b", "a", "c"));
  EXPECT_TRUE(in_memory("b"));
  rescan(3);
  EXPECT_TRUE(in_memory("b"));
  config_.scenes = {folder_ / "b.ply", folder_ / "b.ply"};
  start();
  EXPECT_THAT(names(), ElementsAre("b", "a", "c")) << "given twice, and still one";
}

TEST_F(SceneLibraryTime, AFileBehindALinkedFolderIsOneScene) {
  const TemporaryFolder elsewhere;
  const auto link = elsewhere / "exhibition";
  std::filesystem::create_directory_symlink(folder_.path(), link);
  config_.scene_folders = {folder_.path(), link};
  start();
  EXPECT_THAT(names(), ElementsAre("city", "a", "b", "c"));
  config_.scenes = {link / "b.ply", folder_ / "b.ply"};
  start();
  EXPECT_THAT(names(), ElementsAre("b", "a", "c"));
}

TEST_F(SceneLibraryTime, AFileThatGoesBeforeItIsLoadedIsForgotten) {
  EXPECT_TRUE(awaited("a"));
  EXPECT_TRUE(awaited("b"));
  std::filesystem::remove(folder_ / "b.ply");
  rescan(3);
  run_until([&] {
    tick(31s);
    return !has("b");
  });
}

TEST_F(SceneLibraryTime, TheFirstSceneThatCanBeLoadedIsTheDefaultOne) {
  library_.reset();
  config_.scenes.clear();
  const auto damage = [&](const std::filesystem::path& name) {
    save_scene(random_cloud(5000, 3), folder_ / name);
    std::filesystem::resize_file(folder_ / name, 20'000);
  };
  std::filesystem::remove(folder_ / "a.ply");
  damage("a.spz");
  start();
  EXPECT_EQ(names().front(), "b");
  EXPECT_THAT(refusal("a").message, HasSubstr("could not be loaded"));
  EXPECT_EQ(metrics_.scene_loads_failed.Value(), 1);
  library_.reset();
  for (const char* name : {"b", "c"}) {
    std::filesystem::remove(folder_ / (std::string(name) + ".ply"));
    damage(std::string(name) + ".spz");
  }
  EXPECT_THAT(input_error([&] { start(); }), HasSubstr("a.spz"));
}

}  // namespace
}  // namespace catgs::test
