// Runs the program itself: exit codes, messages, files.
#include "tests/render_core/tools/catgs_render.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/image/png.h"
#include "render_core/motion/trajectory.h"
#include "render_core/scene/files/save_scene.h"
#include "render_core/scene/tree/tree_shape.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using test::Outcome;
using test::run;
using test::run_command;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

using test::ball;
using test::CatgsRender;

TEST_F(CatgsRender, FilesWriteNoColoursIntoTheTerminal) {
  const auto evil = folder_.write("evil.ply", "ply\nformat \x1b[31mevil 1.0\n");
  const Outcome info = run("info " + evil.string());
  EXPECT_EQ(info.exit_code, 2);
  EXPECT_THAT(info.out, HasSubstr("unknown encoding '\\x1b[31mevil'"));
}

TEST_F(CatgsRender, FramesOfATraceAreItsSamples) {
  const Outcome outcome = frames(fmt::format("--trace {} --out {}", path("path.tum"), path("out")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_TRUE(std::filesystem::exists(path("out/frame_000000.png")));
  EXPECT_TRUE(std::filesystem::exists(path("out/frame_000002.png")));
  EXPECT_FALSE(std::filesystem::exists(path("out/frame_000003.png")));
  const Image image = read_png(path("out/frame_000000.png"));
  EXPECT_EQ(image.size_px, glm::ivec2(64, 48));
  const float* centre = image.row(24) + 32 * 3;
  EXPECT_GT(centre[0] + centre[1] + centre[2], 0.2f);  // the ball, not the background
  EXPECT_EQ(image.row(0)[0], 0.0f);
}

TEST_F(CatgsRender, ARangeOfAResampledTraceKeepsItsNumbers) {
  const Outcome outcome = frames(
      fmt::format("--trace {} --fps 10 --frames 4:6 --out {}", path("path.tum"), path("out")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_TRUE(std::filesystem::exists(path("out/frame_000004.png")));
  EXPECT_TRUE(std::filesystem::exists(path("out/frame_000005.png")));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(path("out")), {}), 2);
}

TEST_F(CatgsRender, AnAnchoredTraceLooksAtTheScene) {
  write_tum(path("far.tum"), {{0, {glm::vec3(500, 0, 0), {1, 0, 0, 0}}}});
  const auto brightest = [&](const std::string& flags) {
    const Outcome outcome =
        frames(fmt::format("--trace {} {} --out {}", path("far.tum"), flags, path("a.png")));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
    const Image image = read_png(path("a.png"));
    return *std::max_element(image.rgb.begin(), image.rgb.end());
  };
  EXPECT_EQ(brightest(""), 0.0f);
  EXPECT_GT(brightest("--anchor"), 0.2f);
}

TEST_F(CatgsRender, ChecksPixelsAgainstTheReference) {
  const Outcome outcome =
      frames(fmt::format("--trace {} --frames :1 --pixels 200 --renderer cpu", path("path.tum")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const std::size_t line = outcome.out.find("all frames");
  ASSERT_NE(line, std::string::npos) << outcome.out;
  EXPECT_GE(std::stod(outcome.out.substr(line + 10)), 60.0) << outcome.out;
}

TEST_F(CatgsRender, CompareExitsWithOneWhereTheRequirementFails) {
  const Outcome outcome = frames(fmt::format("--trace {} --out {}", path("path.tum"), path("out")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const std::string pair = path("out/frame_000000.png") + " " + path("out/frame_000002.png");
  const std::string same = path("out/frame_000000.png") + " " + path("out/frame_000000.png");
  EXPECT_EQ(run("compare " + pair).exit_code, 0);
  const Outcome failed = run("compare --require-psnr 60 " + pair);
  EXPECT_EQ(failed.exit_code, 1);
  EXPECT_THAT(failed.out, HasSubstr("below the required 60.00 dB"));
  EXPECT_EQ(run("compare --require-psnr 60 " + same).exit_code, 0);
  const auto json = nlohmann::json::parse(run("compare --json " + same).out);
  EXPECT_TRUE(json.at("psnr_db").is_null());
  EXPECT_EQ(json.at("ssim"), 1.0);
}

TEST_F(CatgsRender, BenchDrawsBothEyes) {
  const Outcome outcome = run(fmt::format(
      "bench {} --stereo --size 64x48 --script orbit --duration 0.1 --quality --json {}", scene(),
      path("bench.json")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  std::ifstream file(path("bench.json"));
  const auto json = nlohmann::json::parse(file);
  EXPECT_EQ(json.at("settings").at("size_px"), (nlohmann::json{128, 48}));
  EXPECT_FLOAT_EQ(json.at("settings").at("eye_distance").get<float>(), 0.064f);
  EXPECT_GE(json.at("quality").at("key").at("psnr_db").at("min").get<double>(), 60.0);
}

TEST_F(CatgsRender, BenchReportsEveryFrame) {
  const Outcome outcome =
      run(fmt::format("bench {} --size 64x48 --script orbit --duration 0.1 --quality --json {}",
                      scene(), path("bench.json")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  std::ifstream file(path("bench.json"));
  const auto json = nlohmann::json::parse(file);
  EXPECT_EQ(json.at("key_frames").get<int>() + json.at("sub_frames").get<int>(), 12);
  EXPECT_EQ(json.at("scene").at("gaussians"), 400);
  EXPECT_EQ(json.at("settings").at("size_px"), (nlohmann::json{64, 48}));
  EXPECT_EQ(json.at("settings").at("seed"), 1);
  EXPECT_EQ(json.at("settings").at("duration_s"), 0.1);
  EXPECT_EQ(json.at("settings").at("warmup"), 10);
  EXPECT_GT(json.at("fps_mean").get<double>(), 0.0);
  EXPECT_GE(json.at("frame_ms").at("max"), json.at("frame_ms").at("p50"));
  EXPECT_GT(json.at("blended_pairs_mean").get<double>(), 64.0);
  EXPECT_GE(json.at("quality").at("key").at("psnr_db").at("min").get<double>(), 60.0);
  for (const char* field :
       {"commit", "device", "flatness", "stage_ms", "list_length", "window_histogram",
        "ns_per_gaussian", "ns_per_blended_pair", "device_bytes", "frame_ms_key", "frame_ms_sub",
        "stage_ms_key", "list_length_key", "windows_cut", "view_bytes"}) {
    EXPECT_TRUE(json.contains(field)) << field;
  }
}

TEST_F(CatgsRender, BenchTriesItsOutputsBeforeTheSceneIsLoaded) {
  const auto bench = [&](const std::string& outputs) {
    return run(fmt::format("bench {} --script orbit --quality --pipeline catgs {}",
                           path("absent.ply"), outputs));
  };
  const std::string nowhere = path("no/bench.json");
  for (const char* outputs : {"--json {0}", "--worst /proc/none", "--worst {1}/worst"}) {
    const Outcome outcome = bench(fmt::format(fmt::runtime(outputs), nowhere, scene()));
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.out, Not(HasSubstr("absent.ply"))) << outcome.out;
  }
  std::ofstream(path("bench.json")) << "old";
  EXPECT_THAT(bench("--json " + path("bench.json")).out, HasSubstr("absent.ply"));
  EXPECT_EQ(std::filesystem::file_size(path("bench.json")), 3u);
}

TEST_F(CatgsRender, BenchTellsSubFramesFromKeyFrames) {
  const auto bench = [&](const std::string& flags) {
    const Outcome outcome =
        run(fmt::format("bench {} --size 64x48 --script orbit --duration 0.5 --renderer cpu "
                        "--pipeline paper --warmup 1 {} --json {}",
                        scene(), flags, path("bench.json")));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
    std::ifstream file(path("bench.json"));
    return nlohmann::json::parse(file);
  };
  // 60 frames: two that know no motion yet, then groups of five.
  const auto json = bench("--quality --quality-every 1");
  EXPECT_EQ(json.at("key_frames"), 14);
  EXPECT_EQ(json.at("sub_frames"), 46);
  EXPECT_EQ(json.at("window_histogram"), (nlohmann::json{{"0", 2}, {"4", 12}}));
  EXPECT_EQ(json.at("windows_cut"), 0);
  EXPECT_EQ(json.at("settings").at("constant_velocity"), false);
  EXPECT_GT(json.at("frame_ms_sub").at("mean").get<double>(), 0.0);
  EXPECT_EQ(json.at("quality").at("sub").at("frames"), 46);
  const auto worst_psnr = [&](const char* kind) {  // null: all pictures are identical
    const auto& value = json.at("quality").at(kind).at("psnr_db").at("min");
    return value.is_null() ? 1000.0 : value.get<double>();
  };
  EXPECT_GE(worst_psnr("key"), 60.0);
  EXPECT_GE(worst_psnr("sub"), 50.0);
  EXPECT_EQ(json.at("quality").at("pop").at("steps"), 13);
  EXPECT_LE(json.at("quality").at("pop").at("max").get<double>(), 2.0 / 255.0);
  EXPECT_GT(json.at("quality").at("see_through").at("mean").get<double>(), 0.2);

  // Each view starts anew; that cuts no group.
  const auto together = bench("--views 3");
  EXPECT_EQ(together.at("settings").at("views"), 3);
  EXPECT_EQ(together.at("key_frames"), 3 * 14);
  EXPECT_EQ(together.at("sub_frames"), 3 * 46);
  EXPECT_EQ(together.at("windows_cut"), 0);

  const auto uncached = bench("--no-cache");
  EXPECT_EQ(uncached.at("key_frames"), 60);
  EXPECT_TRUE(uncached.at("frame_ms_sub").is_null());
}

TEST_F(CatgsRender, BadInputExitsWithTwoAndSaysWhatToDo) {
  const auto expect = [](const Outcome& outcome, const std::string& message) {
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    EXPECT_THAT(outcome.out, HasSubstr(message));
  };
  const std::string still = "--script still --frames :1 ";
  expect(run(""), "catgs-render: A subcommand is required");
  expect(run("frames"), "scene is required");
  expect(run(fmt::format("frames {} --script still --out x", path("none.ply"))),
         "catgs-render: " + path("none.ply"));
  expect(frames("--out x"), "--trace, --script: one of them is needed");
  expect(frames(still), "--out: is missing");
  expect(frames("--script jump --out x"), "unknown script \"jump\"");
  expect(frames("--script still --trace x --out x"), "--trace excludes --script");
  expect(run("frames x.ply --size 64 --out x"), "--size: \"64\" is not a picture size");
  expect(frames(still + "--fov-deg 180 --out x"), "the focal length must be positive");
  expect(frames(still + "--renderer gpu --out x"), "--renderer: unknown \"gpu\" (one of auto, cpu");
  expect(frames(still + "--device gpu --out x"), "--device: \"gpu\" is neither all nor a list");
  expect(frames(still + "--renderer cpu --device 1 --out x"),
         "--device: chooses among CUDA devices");
  expect(frames("--script orbit --out " + path("a.png")), "one picture for 300 frames");
  expect(frames("--script still --frames 2000: --out x"), "the path has 300 frames");
  expect(frames(still + "--window 2 --out x"), "--window: has no effect on the exact pipeline");
  expect(frames(still + "--renderer cpu --pipeline catgs --window 2 --out x"),
         "--window: has no effect on the catgs pipeline of this core (use --renderer cuda, or "
         "--pipeline paper)");
  expect(frames(still + "--pipeline paper --window -1 --out x"), "--window: is out of range");
  expect(frames("--trace x --duration 2 --out x"), "--duration: has no effect on a recorded trace");
  expect(frames("--trace x --seed 1 --out x"), "--seed: has no effect on a recorded trace");
  expect(
      frames(still + "--pipeline vanilla --max-deviation-px 1 --out x"),
      "--max-deviation-px: has no effect on the vanilla pipeline (use --pipeline paper or catgs)");
  expect(run(fmt::format("bench {} --script still --frames :2 --warmup 100000000000", scene())),
         "--warmup: 100000000000 frames of a path of 2");
  expect(frames(still + "--near inf --out x"), "--near: inf is not a positive, finite distance");
  expect(frames(still + "--near 0 --out x"), "--near: 0 is not a positive, finite distance");
  expect(frames(still + "--clip 0,0,0,1 --out x"), "--clip: has a normal of 0");
  expect(frames(still + "--orthographic 0 --out x"), "--orthographic: the focal length");
  expect(frames(still + "--orthographic 5 --fov-deg 60 --out x"),
         "--fov-deg excludes --orthographic");
  expect(frames(still + "--section 0,0,0,1,2 --out x"),
         "--section: \"0,0,0,1,2\" is not 7 numbers");
  expect(frames(still + "--section 0,0,0,1,0,1,0 --out x"), "--section: has a side that is not");
  expect(frames("--script tour: --out x"), "--script: tour: names no file");
  std::ofstream(path("tours.json")) << R"({"tours": []})";
  expect(frames("--script tour:" + path("tours.json") + " --out x"), "tours.json: is a sidecar");
  expect(run(fmt::format("trace anchor {} --trace {} --fps 0 --out x", scene(), path("path.tum"))),
         "--fps: Value 0 not in range");
  expect(run("bnech " + scene()), "unknown command bnech: did you mean bench?");
  expect(run("compare " + path("none.png") + " " + path("none.png")), path("none.png"));
}

TEST_F(CatgsRender, IsSilentInAPipe) {
  const Outcome outcome = run(fmt::format(
      "--quiet frames {} --size 64x48 --script still --frames :2 --out {}", scene(), path("out")));
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.out, "");
}

TEST_F(CatgsRender, InfoDescribesTheScene) {
  const Outcome text = run("info " + scene());
  ASSERT_EQ(text.exit_code, 0) << text.out;
  EXPECT_THAT(text.out, AllOf(HasSubstr("3DGS ply"), HasSubstr("400, SH degree 0"),
                              HasSubstr("first view      estimated")));
  const auto json = nlohmann::json::parse(run("info --json " + scene()).out);
  EXPECT_EQ(json.at("gaussians"), 400);
  EXPECT_EQ(json.at("sanitize").at("dropped"), 0);
  EXPECT_NEAR(json.at("opacity").at("p50").get<double>(), 0.9, 1e-6);
  EXPECT_NEAR(json.at("robust_bounds").at("min")[2].get<double>(), -0.9, 0.02);
  EXPECT_GT(json.at("peak_rss_bytes").get<double>(), json.at("bytes").get<double>());
  std::ofstream(path("ball.json")) << R"({"tours": [{"stops": [{"position": [0, 0, 0]}]}]})";
  EXPECT_THAT(run("info " + scene()).out,
              HasSubstr("ball.json: tours[0].stops[0]: 'look_at' or 'orientation' is missing"));
  const Outcome failed = run("info " + path("absent.ply"));
  EXPECT_EQ(failed.exit_code, 2);
  EXPECT_THAT(failed.out, HasSubstr("absent.ply: does not exist"));
}

TEST_F(CatgsRender, ReportsAreJsonWhateverTheFilesAreCalled) {
  const std::string odd = path("b\xe4ll.ply");
  std::filesystem::copy_file(scene(), odd);
  std::ofstream(path("b\xe4ll.json")) << R"({"near": 0.125})";
  const auto info = nlohmann::json::parse(run(fmt::format("info --json '{}'", odd)).out);
  EXPECT_EQ(info.at("name"), "b\ufffdll");
  EXPECT_EQ(info.at("hints").at("source"), "sidecar b\ufffdll.json");
  const Outcome bench =
      run(fmt::format("bench '{}' --trace {} --size 64x48 --frames 0:2 --warmup 0 --json -", odd,
                      path("path.tum")));
  ASSERT_EQ(bench.exit_code, 0) << bench.out;
  EXPECT_EQ(nlohmann::json::parse(bench.out).at("scene").at("name"), "b\ufffdll");
}

TEST_F(CatgsRender, ConvertPrunesAndKeepsTheHints) {
  std::ofstream(path("ball.json")) << R"({"near": 0.125})";
  const Outcome outcome =
      run(fmt::format("convert {} {} --keep-fraction 0.25", scene(), path("small.spz")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("100 of 400 Gaussians"));
  const auto json = nlohmann::json::parse(run("info --json " + path("small.spz")).out);
  EXPECT_EQ(json.at("format"), "spz v3");
  EXPECT_EQ(json.at("gaussians"), 100);
  EXPECT_EQ(json.at("hints").at("near"), 0.125);
  EXPECT_EQ(run(fmt::format("convert {} {}", scene(), path("a.obj"))).exit_code, 2);
  EXPECT_EQ(run(fmt::format("convert {} {} --keep-fraction 0", scene(), path("a.ply"))).exit_code,
            2);
}

TEST_F(CatgsRender, ConvertRefusesToWriteOverItsInputOrAnUnwrittenFormat) {
  const auto size = std::filesystem::file_size(path("ball.ply"));
  std::filesystem::create_hard_link(path("ball.ply"), path("alias.ply"));
  for (const char* name : {"ball.ply", "./ball.ply", "alias.ply"}) {
    const Outcome outcome =
        run(fmt::format("convert {} {} --keep-fraction 0.5", path("ball.ply"), path(name)));
    EXPECT_EQ(outcome.exit_code, 2) << name;
    EXPECT_THAT(outcome.out, AllOf(HasSubstr(name), HasSubstr("another name")));
  }
  EXPECT_EQ(std::filesystem::file_size(path("ball.ply")), size);
  const Outcome compressed =
      run(fmt::format("convert {} {}", path("ball.ply"), path("y.compressed.ply")));
  EXPECT_EQ(compressed.exit_code, 2);
  EXPECT_THAT(compressed.out, AllOf(HasSubstr("compressed PLY"), HasSubstr(".spz")));
  EXPECT_FALSE(std::filesystem::exists(path("y.compressed.ply")));
}

TEST_F(CatgsRender, ConvertLeavesASidecarThatIsThere) {
  std::ofstream(path("ball.json")) << R"({"near": 0.125})";
  std::ofstream(path("copy.json")) << R"({"near": 0.5})";
  const Outcome outcome = run(fmt::format("convert {} {}", scene(), path("copy.ply")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("copy.json exists and was left as it is"));
  const auto json = nlohmann::json::parse(run("info --json " + path("copy.ply")).out);
  EXPECT_EQ(json.at("hints").at("near"), 0.5);
}

TEST_F(CatgsRender, SynthesizedScenesKeepTheirStartPose) {
  const Outcome outcome = run("synth city --gaussians 1000 " + path("city.ply"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const auto json = nlohmann::json::parse(run("info --json " + path("city.ply")).out);
  EXPECT_EQ(json.at("hints").at("source"), "sidecar city.json");
}

/// deploy/run.sh makes them with these options, and puts the demo's sidecars in place of theirs.
TEST_F(CatgsRender, SidecarsOfTheDemoHaveTheHintsOfItsScenes) {
  for (const auto& [scene, options] : std::initializer_list<std::pair<const char*, const char*>>{
           {"city", "--gaussians 300000"}, {"garden", "--gaussians 150000"}}) {
    const std::string made = path(fmt::format("{}.splat", scene));
    ASSERT_EQ(run(fmt::format("synth {} {} {}", scene, options, made)).exit_code, 0);
    const auto numbers_in = [](const std::string& sidecar) {
      auto json = nlohmann::json::parse(std::ifstream(sidecar));
      json.erase("convert_hash");
      return json.flatten();
    };
    const auto hints = numbers_in(path(fmt::format("{}.json", scene)));
    const auto demo = numbers_in(fmt::format("{}/deploy/demo/{}.json", CATGS_SOURCE_DIR, scene));
    EXPECT_GT(hints.size(), 15u);
    for (const auto& [field, value] : hints.items())
      EXPECT_NEAR(demo.value(field, 1e9), value.get<double>(), 1e-4) << scene << field;
  }
}

TEST_F(CatgsRender, ConvertsToATreeAndBack) {
  const Outcome there = run(fmt::format("convert {} {}", scene(), path("ball.tree")));
  ASSERT_EQ(there.exit_code, 0) << there.out;
  const auto tree = nlohmann::json::parse(run("info --json " + path("ball.tree")).out);
  EXPECT_EQ(tree.at("format"), "tree");
  EXPECT_EQ(tree.at("gaussians"), 400);
  EXPECT_EQ(tree.at("missing_bytes"), 0);
  ASSERT_EQ(tree.at("levels").size(), 2u);
  EXPECT_EQ(tree.at("levels")[0].at("gaussians"), 256);
  EXPECT_GT(tree.at("levels")[0].at("mean_error"), 0.0);
  std::ofstream(path("ball.json")) << R"({"tours": [7]})";
  EXPECT_THAT(run("info " + path("ball.tree")).out,
              AllOf(HasSubstr("bytes per Gaussian"), HasSubstr("3DGS ply"),
                    HasSubstr("ball.json: tours[0]: is not an object")));

  ASSERT_EQ(run(fmt::format("convert {} {}", path("ball.tree"), path("back.ply"))).exit_code, 0);
  const auto back = nlohmann::json::parse(run("info --json " + path("back.ply")).out);
  EXPECT_EQ(back.at("gaussians"), 400);
  const Outcome memory = run(fmt::format("convert {} {} --memory -1", scene(), path("other.tree")));
  EXPECT_EQ(memory.exit_code, 2);
  EXPECT_THAT(memory.out, HasSubstr("--memory"));
}

TEST_F(CatgsRender, InfoRefusesATreeWithoutItsRoot) {
  ASSERT_EQ(run(fmt::format("convert {} {}", scene(), path("ball.tree"))).exit_code, 0);
  std::filesystem::resize_file(path("ball.tree"), TreeShape::header_bytes + 100);
  const Outcome info = run("info " + path("ball.tree"));
  EXPECT_EQ(info.exit_code, 2);
  EXPECT_THAT(info.out, HasSubstr("page 0: nothing can be seen without it"));
}

TEST_F(CatgsRender, DrawsATreeFromItsPages) {
  const std::string tree = path("city.tree");
  ASSERT_EQ(run("synth city --gaussians 40000 " + tree).exit_code, 0);
  const auto bench = [&](const std::string& flags) {
    const Outcome done = run(fmt::format(
        "bench {} --script walk --duration 0.2 --fps 30 --size 160x90 --renderer cpu --pipeline "
        "catgs --quality --quality-every 3 --json - {}",
        tree, flags));
    EXPECT_EQ(done.exit_code, 0) << done.out;
    return nlohmann::json::parse(done.out);
  };
  const auto all = bench("--detail 0"), coarse = bench("--detail 8");
  const auto few = bench("--detail 0 --scene-memory 0.001");
  EXPECT_EQ(all.at("pages").at("missing_max"), 0);
  EXPECT_GT(all.at("pages").at("sharp_ms").at("mean"), 0.0);
  EXPECT_GT(all.at("quality").at("key").at("psnr_db").at("mean"), 50.0);
  EXPECT_LT(coarse.at("visible_mean"), 0.7 * all.at("visible_mean").get<double>());
  EXPECT_EQ(few.at("pages").at("missing_max"), 0) << "pages that have no room are not missing";
  EXPECT_GT(few.at("pages").at("coarsest_px"), all.at("pages").at("coarsest_px"));
  EXPECT_LT(few.at("scene_bytes"), all.at("scene_bytes"));

  const Outcome whole = frames("--trace " + path("path.tum") + " --detail 1 --out " + path("out"));
  EXPECT_EQ(whole.exit_code, 2);
  EXPECT_THAT(whole.out, AllOf(HasSubstr("ball.ply"), HasSubstr("convert")));
  const Outcome alpha = run(fmt::format(
      "frames {} --script still --size 64x48 --detail 1 --alpha --out {}", tree, path("out")));
  EXPECT_EQ(alpha.exit_code, 2);
  EXPECT_THAT(alpha.out, HasSubstr("--detail"));
}

TEST_F(CatgsRender, SynthesizedTreesAreThoseOfTheWholeScene) {
  ASSERT_EQ(run("synth city --gaussians 5000 " + path("a.tree")).exit_code, 0);
  ASSERT_EQ(run("synth city --gaussians 5000 --memory 0 " + path("b.tree")).exit_code, 0);
  EXPECT_EQ(run_command(fmt::format("cmp {} {}", path("a.tree"), path("b.tree"))).exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(path("a.json")));
}

TEST_F(CatgsRender, SynthRefusesWhatItCannotMake) {
  const Outcome unknown = run(fmt::format("synth castle {}", path("castle.ply")));
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.out, AllOf(HasSubstr("castle"), HasSubstr("city, garden, stress")));
  EXPECT_EQ(run(fmt::format("synth city {} --gaussians 10", path("few.ply"))).exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(path("few.ply")));
}

}  // namespace
}  // namespace catgs
