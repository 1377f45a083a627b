// catgs-render floors and walk: where people can walk in a scene, and a walk that checks it.
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/scene/files/save_scene.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/walk/walk_file.h"
#include "tests/render_core/tools/run_catgs_render.h"
#include "tests/render_core/walk/worlds.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class WalkCommands : public ::testing::Test {
 protected:
  WalkCommands() {
    save_scene(room(0.9f), folder_ / "room.ply");
    folder_.write(
        "room.json",
        R"({"up": [0, 0, 1], "start_pose": {"position": [2, 2, 1.6], "look_at": [2, 5, 1.6]}})");
  }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_ / name).string();
  }
  [[nodiscard]] Outcome floors(const std::string& options) const {
    return run(fmt::format("floors {} {} {}", path("room.ply"), path("room.walk"), options));
  }
  const TemporaryFolder folder_;
};

TEST_F(WalkCommands, AWalkThroughARoomPassesNoWall) {
  const Outcome found = floors("--eye-height 1.6 --plan " + path("plan.png"));
  ASSERT_EQ(found.exit_code, 0) << found.out;
  EXPECT_THAT(found.out, AllOf(HasSubstr("eye height 1.6, cells of 0.1"), HasSubstr("storey 0")));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "plan.png"));
  const walk::WalkMap map = walk::read_walk_file(FileSource(folder_ / "room.walk"));
  EXPECT_GT(map.places.size(), 2000u);
  const Outcome walked =
      run(fmt::format("walk {} {} --minutes 0.5", path("room.walk"), path("room.ply")));
  EXPECT_EQ(walked.exit_code, 0) << walked.out;
  EXPECT_THAT(walked.out, HasSubstr("0 of "));
  const Outcome place = run(fmt::format("walk {} --at 6 3 2", path("room.walk")));
  EXPECT_EQ(place.exit_code, 0);
  EXPECT_THAT(place.out, HasSubstr("eyes at 6 3 1.6"));
}

TEST_F(WalkCommands, TheRoomTellsTheEyeHeight) {
  const Outcome found = floors("");
  ASSERT_EQ(found.exit_code, 0) << found.out;
  EXPECT_THAT(found.out, HasSubstr("(estimated)"));
  const walk::WalkMap map = walk::read_walk_file(FileSource(folder_ / "room.walk"));
  EXPECT_NEAR(map.grid.cell * walk::cells_per_eye_height, 1.6f, 0.25f);
}

TEST_F(WalkCommands, TheSidecarsUnitTellsTheEyeHeight) {
  folder_.write(
      "room.json",
      R"({"up": [0, 0, 1], "start_pose": {"position": [2, 2, 1.6], "look_at": [2, 5, 1.6]}, "metres_per_unit": 1})");
  const Outcome found = floors("");
  ASSERT_EQ(found.exit_code, 0) << found.out;
  EXPECT_THAT(found.out, HasSubstr("eye height 1.6 (1.6 m), cells of 0.1"));
}

/// The walls are not those of the scene that the map is of.
TEST_F(WalkCommands, AWalkThroughWallsFails) {
  ASSERT_EQ(floors("--eye-height 1.6").exit_code, 0);
  GaussianCloud other = room(0.9f);
  add_plate(other, {2.7f, 0, 0}, {0, 6, 0}, {0, 0, 2.6f});
  save_scene(other, folder_ / "other.ply");
  const Outcome walked =
      run(fmt::format("walk {} {} --minutes 0.5", path("room.walk"), path("other.ply")));
  EXPECT_EQ(walked.exit_code, 1);
  EXPECT_THAT(walked.out, Not(HasSubstr("\n0 of ")));
}

TEST_F(WalkCommands, WhatCannotBeDoneIsSaid) {
  EXPECT_THAT(floors("--eye-height 0").out, HasSubstr("--eye-height"));
  const Outcome high = floors("--eye-height 30");
  EXPECT_NE(high.exit_code, 0);
  EXPECT_THAT(high.out, HasSubstr("nobody can stand"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "room.walk"));
  EXPECT_THAT(run(fmt::format("floors {} {}", path("room.ply"), path("room.png"))).out,
              HasSubstr("room.png: is no name of a .walk file"));
  EXPECT_THAT(run("floors " + path("room.ply")).out,
              HasSubstr("out is required (see catgs-render floors --help)"));
  EXPECT_THAT(run("walk " + path("room.ply")).out, HasSubstr("catgs-render floors SCENE OUT.walk"));
  folder_.write("bad.walk", "no walk file");
  const Outcome bad = run("walk " + path("bad.walk"));
  EXPECT_NE(bad.exit_code, 0);
  EXPECT_THAT(bad.out, HasSubstr("bad.walk"));
}

}  // namespace
}  // namespace catgs::test
