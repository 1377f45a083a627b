// catgs-render floors: where people can walk in a scene.
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

class Floors : public ::testing::Test {
 protected:
  Floors() {
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

TEST_F(Floors, WritesAMapAndAPlan) {
  const Outcome found = floors("--eye-height 1.6 --plan " + path("plan.png"));
  ASSERT_EQ(found.exit_code, 0) << found.out;
  EXPECT_THAT(found.out, AllOf(HasSubstr("eye height 1.6, cells of 0.1"), HasSubstr("storey 0")));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "plan.png"));
  const walk::WalkMap map = walk::read_walk_file(FileSource(folder_ / "room.walk"));
  EXPECT_GT(map.positions.size(), 2000u);
}

TEST_F(Floors, TheRoomTellsTheEyeHeight) {
  const Outcome found = floors("");
  ASSERT_EQ(found.exit_code, 0) << found.out;
  EXPECT_THAT(found.out, HasSubstr("(estimated)"));
  const walk::WalkMap map = walk::read_walk_file(FileSource(folder_ / "room.walk"));
  EXPECT_NEAR(map.grid.cell * walk::cells_per_eye_height, 1.6f, 0.25f);
}

TEST_F(Floors, TheSidecarsUnitTellsTheEyeHeight) {
  folder_.write(
      "room.json",
      R"({"up": [0, 0, 1], "start_pose": {"position": [2, 2, 1.6], "look_at": [2, 5, 1.6]}, "metres_per_unit": 1})");
  const Outcome found = floors("");
  ASSERT_EQ(found.exit_code, 0) << found.out;
  EXPECT_THAT(found.out, HasSubstr("eye height 1.6 (1.6 m), cells of 0.1"));
}

TEST_F(Floors, MistakesAreNamed) {
  EXPECT_THAT(floors("--eye-height 0").out, HasSubstr("--eye-height"));
  const Outcome high = floors("--eye-height 30");
  EXPECT_NE(high.exit_code, 0);
  EXPECT_THAT(high.out, HasSubstr("nobody can stand"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "room.walk"));
  EXPECT_THAT(run(fmt::format("floors {} {}", path("room.ply"), path("room.png"))).out,
              HasSubstr("room.png: is not the name of a .walk file"));
  EXPECT_THAT(run("floors " + path("room.ply")).out,
              HasSubstr("out is required (see catgs-render floors --help)"));
}

}  // namespace
}  // namespace catgs::test
