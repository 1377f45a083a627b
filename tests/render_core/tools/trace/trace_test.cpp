// catgs-render trace, and camera paths on the command line.
#include <array>
#include <filesystem>
#include <string>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/image/png.h"
#include "render_core/motion/trajectory.h"
#include "tests/render_core/tools/catgs_render.h"

namespace catgs {
namespace {

using test::Outcome;
using test::run;
using test::run_command;
using ::testing::AllOf;
using ::testing::HasSubstr;

using Trace = test::CatgsRender;

TEST_F(Trace, WritesAScriptedTrace) {
  const Outcome outcome =
      run(fmt::format("trace script {} --script head --seed 4 --duration 2 --fps 60 --out {}",
                      scene(), path("head.tum")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_EQ(read_tum(path("head.tum")).size(), 120u);
}

TEST_F(Trace, TheFixedPathsOfTheCityAreFitAndStay) {
  ASSERT_EQ(run("synth city --gaussians 50000 " + path("city.ply")).exit_code, 0);
  const Outcome made = run_command(
      fmt::format("{}/make_paths.sh {} {}", CATGS_CITY_PATHS, CATGS_RENDER, path("paths")));
  ASSERT_EQ(made.exit_code, 0) << made.out;
  // Tables of different versions can be compared as long as these poses stay: x, y, z and qx, qy,
  // qz, qw in the middle and at the end.
  struct FixedPath {
    const char* name;
    std::array<float, 7> middle, end;
  };
  const FixedPath paths[] = {
      {"head",
       {2.1399f, -11.0494f, -15.4778f, 0.0232f, 0.1734f, 0.0435f, 0.9836f},
       {2.2537f, -11.0008f, -15.4913f, -0.0396f, 0.4777f, -0.0103f, 0.8776f}},
      {"walk",
       {2.1903f, -11.0000f, -13.0060f, -0.0482f, -0.1239f, -0.0060f, 0.9911f},
       {2.3507f, -10.9981f, -10.0203f, -0.0063f, 0.0991f, 0.0006f, 0.9951f}},
      {"orbit",
       {11.3311f, -11.0000f, -9.4106f, -0.1240f, -0.4965f, -0.0719f, 0.8561f},
       {12.2947f, -11.0000f, 1.9362f, -0.0822f, -0.8110f, -0.1175f, 0.5672f}},
      {"pan",
       {6.9221f, -11.0000f, -15.1210f, -0.0609f, -0.0881f, -0.0054f, 0.9942f},
       {2.0164f, -11.0000f, -15.9971f, -0.0609f, -0.0881f, -0.0054f, 0.9942f}},
      {"zoom",
       {1.1276f, -10.3893f, -11.1147f, -0.0609f, -0.0881f, -0.0054f, 0.9942f},
       {1.9971f, -10.9980f, -15.9837f, -0.0609f, -0.0881f, -0.0054f, 0.9942f}},
      {"rotate",
       {2.0000f, -11.0000f, -16.0000f, -0.0516f, 0.5354f, 0.0328f, 0.8424f},
       {2.0000f, -11.0000f, -16.0000f, -0.0211f, 0.9368f, 0.0574f, 0.3444f}},
      {"oblique",
       {2.0000f, -22.0000f, -34.0000f, -0.3090f, 0.0000f, 0.0000f, 0.9511f},
       {13.9997f, -22.0000f, -39.9998f, -0.3043f, 0.1651f, 0.0537f, 0.9366f}},
      {"street",
       {0.5000f, -1.7000f, -30.5000f, 0.0000f, 0.0698f, 0.0000f, 0.9976f},
       {0.5000f, -1.7000f, -27.0001f, 0.0000f, -0.0698f, 0.0000f, 0.9976f}}};
  const auto expect_pose = [](const TimedPose& sample, const std::array<float, 7>& pose) {
    const auto& [p, q] = sample.world_from_camera;
    EXPECT_THAT((std::array{p.x, p.y, p.z, q.x, q.y, q.z, q.w}),
                ::testing::Pointwise(::testing::FloatNear(2e-4f), pose));
  };
  for (const FixedPath& fixed : paths) {
    SCOPED_TRACE(fixed.name);
    const std::string file = path(fmt::format("paths/{}.tum", fixed.name));
    const Trajectory poses = read_tum(file);
    ASSERT_EQ(poses.size(), 600u);
    expect_pose(poses[300], fixed.middle);
    expect_pose(poses[599], fixed.end);
    const Outcome outcome =
        run(fmt::format("trace check {} --focal-px 1100 --trace {}", path("city.ply"), file));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
  }
}

TEST_F(Trace, AnUnfitTraceIsNotWritten) {
  // The ball is seen from outside, and the turning camera loses it.
  const std::string rotate =
      fmt::format("trace rotate {} --speed 90 --duration 4 --out {}", scene(), path("turn.tum"));
  const Outcome refused = run(rotate);
  EXPECT_EQ(refused.exit_code, 1) << refused.out;
  EXPECT_THAT(refused.out,
              AllOf(HasSubstr("turn.tum: not written: only"), HasSubstr("--force writes it")));
  EXPECT_FALSE(std::filesystem::exists(path("turn.tum")));
  const Outcome forced = run(rotate + " --force");
  EXPECT_EQ(forced.exit_code, 0) << forced.out;
  EXPECT_THAT(forced.out, HasSubstr("should; frame"));
  EXPECT_EQ(read_tum(path("turn.tum")).size(), 480u);
  const Outcome checked = run(fmt::format("trace check {} --trace {}", scene(), path("turn.tum")));
  EXPECT_EQ(checked.exit_code, 1) << checked.out;
}

TEST_F(Trace, AnOrbitAroundAnObjectIsFit) {
  const Outcome orbit = run(fmt::format("trace orbit {} --speed 90 --duration 4 --fps 30 --out {}",
                                        scene(), path("orbit.tum")));
  ASSERT_EQ(orbit.exit_code, 0) << orbit.out;
  const std::string check = fmt::format("trace check {} --trace ", scene());
  EXPECT_EQ(run(check + path("orbit.tum")).exit_code, 0);
  Trajectory gone = read_tum(path("orbit.tum"));
  gone.back().world_from_camera.position *= 3.0f;
  write_tum(path("gone.tum"), gone);
  const Outcome refused = run(check + path("gone.tum"));
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.out, HasSubstr("1 of 120 frames lie outside"));
}

TEST_F(Trace, PathsOfOtherProgramsBringTheirLens) {
  const auto camera = [](int width) {
    return fmt::format(R"({{"id": 0, "img_name": "a", "width": {}, "height": 30, "fx": 50, "fy": 50,
                            "position": [0, 0, -4], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}})",
                       width);
  };
  const auto draw = [&](const std::string& cameras, const std::string& flags) {
    folder_.write("cameras.json", "[" + cameras + "]");
    return run(fmt::format("frames {} --trace {} {}", scene(), path("cameras.json"), flags));
  };
  const std::string one = "--frames :1 --out " + path("a.png"), both = "--out " + path("both");
  Outcome outcome = draw(camera(40), one);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_EQ(read_png(path("a.png")).size_px, glm::ivec2(40, 30));
  outcome = draw(camera(40) + "," + camera(44), both);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.out, HasSubstr("its pictures have several sizes (choose one with --size"));
  outcome = draw(camera(40) + "," + camera(44), both + " --size 64x48");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_EQ(read_png(path("both/frame_000001.png")).size_px, glm::ivec2(64, 48));

  for (const std::string& command :
       {std::string("bench --size 64x48 --warmup 0 --trace-rate 60"), std::string("trace check"),
        std::string("trace anchor --force --out ") + path("b.tum")}) {
    outcome = run(fmt::format("{} {} --trace {}", command, scene(), path("cameras.json")));
    EXPECT_NE(outcome.exit_code, 2) << outcome.out;
  }
}

TEST_F(Trace, AnchorsATrace) {
  write_tum(path("far.tum"), {{0, {glm::vec3(500, 0, 0), {1, 0, 0, 0}}},
                              {1'000'000, {glm::vec3(500, 0, 0.1f), {1, 0, 0, 0}}}});
  const Outcome outcome = run(fmt::format("trace anchor {} --trace {} --fps 50 --force --out {}",
                                          scene(), path("far.tum"), path("here.tum")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const Trajectory moved = read_tum(path("here.tum"));
  ASSERT_EQ(moved.size(), 51u);
  EXPECT_LT(glm::length(moved[0].world_from_camera.position), 20.0f);
  EXPECT_NEAR(
      glm::distance(moved[0].world_from_camera.position, moved[50].world_from_camera.position),
      0.1f, 1e-4f);
}

}  // namespace
}  // namespace catgs
