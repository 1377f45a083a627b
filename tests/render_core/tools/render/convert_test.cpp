// catgs-render convert: how it edits a scene, and what becomes of the files beside it.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/files/load_scene.h"
#include "tests/render_core/tools/catgs_render.h"

namespace catgs::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class Convert : public CatgsRender {
 protected:
  Outcome convert(const std::string& out, const std::string& options) const {
    return run(fmt::format("convert {} {} {}", scene(), path(out), options));
  }
  void add_title(const std::string& sidecar) const {
    auto json = nlohmann::json::parse(std::ifstream(path(sidecar)));
    json["title"] = "Edited";
    std::ofstream(path(sidecar)) << json;
  }
  nlohmann::json info(const std::string& name) const {
    return nlohmann::json::parse(run("info --json " + path(name)).out);
  }
};

TEST_F(Convert, ScalesThenTurnsThenMovesThenCrops) {
  // A ball of radius 1 becomes one of radius 2 around (0, 10, 0), of which the upper half stays.
  const std::string moves = "--scale 2 --rotate=90,0,0 --translate=0,10,0";
  const std::string box = "--crop=-5,10,-5,5,20,5";
  ASSERT_EQ(convert("moved.ply", moves).exit_code, 0);
  const Outcome outcome = convert("half.ply", moves + " " + box);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("cropped"));
  const GaussianCloud before = load_scene(scene()).cloud,
                      moved = load_scene(path("moved.ply")).cloud;
  const GaussianCloud half = load_scene(path("half.ply")).cloud;
  ASSERT_EQ(moved.size(), 400u);
  std::size_t above = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const glm::vec3& m = before.mean[i];
    EXPECT_LT(glm::distance(moved.mean[i], glm::vec3(2 * m.x, 10 - 2 * m.z, 2 * m.y)), 1e-5f);
    EXPECT_NEAR(moved.scale[i].x, 2.0f * before.scale[i].x, 1e-6f);
    above += moved.mean[i].y >= 10.0f ? 1 : 0;
  }
  EXPECT_EQ(half.size(), above);
  // Parts of a scene on their way into a tree are edited as the whole is.
  const Outcome tree = convert("half.tree", moves + " " + box);
  ASSERT_EQ(tree.exit_code, 0) << tree.out;
  EXPECT_EQ(info("half.tree").at("gaussians"), above);
}

TEST_F(Convert, TurnsAboutXThenYThenZ) {
  ASSERT_EQ(convert("turned.ply", "--rotate=90,90,0").exit_code, 0);
  const GaussianCloud before = load_scene(scene()).cloud;
  const GaussianCloud after = load_scene(path("turned.ply")).cloud;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const glm::vec3& m = before.mean[i];  // (x, y, z) to (x, -z, y) to (y, -z, -x)
    EXPECT_LT(glm::distance(after.mean[i], glm::vec3(m.y, -m.z, -m.x)), 1e-5f);
  }
}

TEST_F(Convert, MovesSidecarAndToursWithTheScene) {
  std::ofstream(path("ball.json")) << R"({
    "start_pose": {"position": [0, 0, -4], "look_at": [0, 0, 0]}, "near": 0.125, "title": "Ball",
    "tours": [{"title": "Way", "stops": [{"position": [1, 0, 0], "look_at": [0, 0, 0]}]}],
    "measures": [{"marks": [{"position": [1, 0, 0], "error": 0.5}, {"position": [0, 0, 0]}]}]})";
  folder_.write("ball.media/door.vtt", "WEBVTT");
  folder_.write("ball.media/hall.vtt", "WEBVTT");
  folder_.write("moved.media/hall.vtt", "there before");
  std::filesystem::create_symlink(path("ball.json"), path("ball.media/link.vtt"));
  const std::string moves = "--scale 2 --translate=0,10,0";
  const Outcome moved = convert("moved.spz", moves);
  ASSERT_EQ(moved.exit_code, 0);
  EXPECT_THAT(moved.out,
              HasSubstr("copied 1 media files from " + path("ball.media") + ", 1 were there"));
  EXPECT_TRUE(std::filesystem::exists(path("moved.media/door.vtt")));
  EXPECT_EQ(std::filesystem::file_size(path("moved.media/hall.vtt")), 12u);
  EXPECT_FALSE(std::filesystem::exists(path("moved.media/link.vtt")));
  const auto sidecar = nlohmann::json::parse(std::ifstream(path("moved.json")));
  EXPECT_EQ(sidecar.at("start_pose").at("position"), nlohmann::json({0.0, 10.0, -8.0}));
  EXPECT_EQ(sidecar.at("near"), 0.25);
  EXPECT_EQ(sidecar.at("title"), "Ball");
  EXPECT_EQ(sidecar.at("tours")[0].at("stops")[0].at("position"), nlohmann::json({2.0, 10.0, 0.0}));
  const auto& mark = sidecar.at("measures")[0].at("marks")[0];
  EXPECT_EQ(mark.at("position"), nlohmann::json({2.0, 10.0, 0.0}));
  EXPECT_EQ(mark.at("error"), 1.0);
  EXPECT_EQ(info("moved.spz").at("hints").at("near"), 0.25);
  // The input's own sidecar would serve this output, too.
  const Outcome shared = convert("ball.sog", moves);
  EXPECT_EQ(shared.exit_code, 2);
  EXPECT_THAT(shared.out, AllOf(HasSubstr("ball.json"), HasSubstr("another name")));
  EXPECT_FALSE(std::filesystem::exists(path("ball.sog")));
}

/// Of the places of a scene, whose order may be another, to the nearest of the wanted ones.
template <class Wanted>
double largest_distance(const Scene& read, const GaussianCloud& before, const Wanted& wanted) {
  double worst = 0.0;
  for (const glm::vec3& mean : read.cloud.mean) {
    double nearest = 1.0;
    for (const glm::vec3& at : before.mean)
      nearest = std::min(nearest, glm::distance(glm::dvec3(mean) + read.hints.origin, wanted(at)));
    worst = std::max(worst, nearest);
  }
  return worst;
}

/// Far from 0, a scene and all that lies in it keep their coordinates to 1e-4.
TEST_F(Convert, FarScenesKeepTheirCoordinates) {
  using nlohmann::json;
  constexpr glm::dvec3 there(500123.4, 5412345.3, 431.2);
  const std::string by = fmt::format("{},{},{}", there.x, there.y, there.z);
  std::ofstream(path("ball.json")) << R"({
    "start_pose": {"position": [0, 0, -4], "look_at": [0, 0, 0]},
    "tours": [{"stops": [{"position": [1, 0, 0], "look_at": [0, 0, 0],
                          "portal": {"scene": "b", "position": [7, 7, 7]}}]}]})";
  ASSERT_EQ(convert("far.ply", "--translate=" + by).exit_code, 0);
  const GaussianCloud before = load_scene(scene()).cloud;
  const auto far_from = [](const json& position, const glm::dvec3& wanted) {
    const glm::dvec3 at(position[0].get<double>(), position[1].get<double>(),
                        position[2].get<double>());
    return glm::distance(at, wanted);
  };
  constexpr glm::dvec3 start(0, 0, -4), aside(1, 0, 0);
  struct Case {
    std::string out;
    glm::dvec3 zero;  // where the ball's middle is
    double tolerance = 1e-4;
    std::string in = "far.ply", options{};
    double scale = 1.0;
  };
  const glm::dvec3 origin = load_scene(path("far.ply")).hints.origin;
  EXPECT_LT(glm::distance(origin, there), 3.0);
  const std::string named = fmt::format("[{}, {}, {}]", origin.x, origin.y, origin.z);
  const glm::dvec3 left = there - origin;
  const std::vector<Case> cases = {
      {"ply.ply", there},
      {"glb.glb", there},
      {"tree.tree", there, 1e-3},
      {"from_tree.ply", there, 1e-3, "tree.tree"},
      {"sog.sog", left},
      {"spz.spz", left},
      {"splat.splat", left},
      {"back.ply",
       {0.0, 0.0, 0.0},
       1e-4,
       "far.ply",
       fmt::format("--translate={},{},{}", -there.x, -there.y, -there.z)},
      {"twice.ply", 2.0 * there, 2e-4, "far.ply", "--scale 2", 2.0}};
  for (const Case& of : cases) {
    SCOPED_TRACE(of.out);
    const Outcome done =
        run(fmt::format("convert {} {} {}", path(of.in), path(of.out), of.options));
    ASSERT_EQ(done.exit_code, 0) << done.out;
    EXPECT_EQ(done.out.find("add " + named) != std::string::npos, of.zero == left);
    const Scene read = load_scene(path(of.out));
    ASSERT_EQ(read.cloud.size(), before.size());
    const auto wanted = [&](const glm::vec3& at) { return of.scale * glm::dvec3(at) + of.zero; };
    EXPECT_LT(largest_distance(read, before, wanted), of.tolerance);
    const std::string sidecar = of.out.substr(0, of.out.find('.')) + ".json";
    const auto told = json::parse(std::ifstream(path(sidecar)));
    const json& stop = told.at("tours")[0].at("stops")[0];
    EXPECT_LT(far_from(told.at("start_pose").at("position"), of.zero + of.scale * start), 1e-4);
    EXPECT_LT(far_from(stop.at("position"), of.zero + of.scale * aside), 1e-4);
    EXPECT_EQ(stop.at("portal").at("position"), json({7, 7, 7})) << "of another scene";
  }
  EXPECT_LT(far_from(info("far.ply").at("hints").at("start_position"), there + start), 1e-4);
  EXPECT_THAT(run(fmt::format("info {}", path("far.ply"))).out, HasSubstr("origin is " + named));
  const Outcome half =
      run(fmt::format("convert {} {} --crop={},{},{},{},{},{}", path("far.ply"), path("half.ply"),
                      there.x - 5, there.y, there.z - 5, there.x + 5, there.y + 5, there.z + 5));
  ASSERT_EQ(half.exit_code, 0) << half.out;
  const auto above =
      std::ranges::count_if(before.mean, [](const glm::vec3& m) { return m.y > 0.0f; });
  EXPECT_EQ(load_scene(path("half.ply")).cloud.size(), static_cast<std::size_t>(above));
  // The sidecar of far.ply counts from another 0 than a SOG would.
  EXPECT_EQ(run(fmt::format("convert {} {}", path("far.ply"), path("far.sog"))).exit_code, 2);
}

TEST_F(Convert, OutputsBeginWhereTheirInputDoes) {
  const auto hints_of = [&](const std::string& name) {
    nlohmann::json hints = info(name).at("hints");
    hints.erase("source");
    hints.erase("scale");  // no sidecar tells it
    return hints;
  };
  const nlohmann::json hints = hints_of("ball.ply");
  for (const char* how : {"few.spz --merge 5%", "half.ply --crop=-5,0,-5,5,5,5", "all.tree"}) {
    const Outcome outcome = convert(how, "");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
    EXPECT_THAT(outcome.out, HasSubstr(".json: first view, estimated")) << how;
    const std::string sidecar = std::string(how).substr(0, std::string(how).find('.')) + ".json";
    EXPECT_EQ(nlohmann::json::parse(std::ifstream(path(sidecar))),
              nlohmann::json::parse(std::ifstream(path("few.json"))))
        << how;
  }
  EXPECT_EQ(hints_of("few.spz"), hints);
  // Pictures of both are of the same cameras.
  for (const auto& [name, out] : {std::pair{"ball.ply", "a"}, std::pair{"few.spz", "b"}})
    ASSERT_EQ(run(fmt::format("frames {} --script orbit --size 64x48 --fps 2 --duration 1 "
                              "--renderer cpu --out {}",
                              path(name), path(out)))
                  .exit_code,
              0);
  const Outcome compared = run(fmt::format("compare --json {} {}", path("a"), path("b")));
  EXPECT_TRUE(nlohmann::json::parse(compared.out).at("cameras_differ").is_null()) << compared.out;

  // Estimates of each scene by itself differ, and scripts can tell.
  std::filesystem::remove(path("few.json"));
  ASSERT_EQ(run(fmt::format("frames {} --script orbit --size 64x48 --fps 2 --duration 1 "
                            "--renderer cpu --out {}",
                            path("few.spz"), path("c")))
                .exit_code,
            0);
  for (const auto& [folder, differ] : {std::pair{"b", false}, std::pair{"c", true}}) {
    const std::string pair = fmt::format("{} {}", path("a"), path(folder));
    EXPECT_EQ(run("compare " + pair).exit_code, 0);
    EXPECT_EQ(run("compare --require-same-cameras " + pair).exit_code, differ ? 1 : 0);
    EXPECT_EQ(run("compare " + pair).out.find("pictures were drawn by other") != std::string::npos,
              differ);
  }

  std::ofstream(path("own.json")) << R"({"near": 0.5})";
  EXPECT_THAT(convert("own.ply", "").out, HasSubstr("own.json exists and was left as it is"));
  EXPECT_EQ(std::filesystem::file_size(path("own.json")), 13u);
  // Another command replaces the sidecar of the one before, but not one that an author changed.
  for (const char* turn : {"30", "30", "31"})
    EXPECT_EQ(convert("twice.ply", fmt::format("--rotate=0,{},0 --scale 3", turn)).exit_code, 0);
  add_title("twice.json");
  EXPECT_EQ(convert("twice.ply", "--rotate=0,32,0 --scale 3").exit_code, 2);
  EXPECT_THAT(run(fmt::format("convert {} {}", path("twice.ply"), path("twice.spz"))).out,
              HasSubstr("twice.json stays as it is: both scenes use it"));
  // A moved view is not that of the input, which has the same sidecar.
  const Outcome moved = convert("ball.spz", "--scale 2");
  EXPECT_EQ(moved.exit_code, 0) << moved.out;
  EXPECT_THAT(moved.out, HasSubstr("ball.json was not written"));
  EXPECT_EQ(hints_of("ball.ply"), hints);
}

TEST_F(Convert, AnotherSceneReplacesTheViewThatConvertWrote) {
  GaussianCloud other = ball();
  for (glm::vec3& mean : other.mean) mean += 7.0f;
  save_scene(other, path("other.ply"));
  const auto text_of = [&](const char* name) {
    std::ifstream file(path(name));
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  const std::string from_other = fmt::format("convert {} ", path("other.ply"));
  ASSERT_EQ(run(from_other + path("fresh.ply")).exit_code, 0);
  ASSERT_EQ(convert("out.ply", "").exit_code, 0);
  ASSERT_NE(text_of("out.json"), text_of("fresh.json"));
  const Outcome replaced = run(from_other + path("out.ply"));
  EXPECT_EQ(text_of("out.json"), text_of("fresh.json")) << replaced.out;
  add_title("out.json");
  const std::string edited = text_of("out.json");
  const Outcome kept = convert("out.ply", "");
  EXPECT_EQ(kept.exit_code, 0);
  EXPECT_THAT(kept.out, HasSubstr("may be of another scene"));
  EXPECT_EQ(text_of("out.json"), edited);
  EXPECT_THAT(run(from_other + path("out.ply")).out, Not(HasSubstr("another scene")));
}

TEST_F(Convert, OutputsOfOneStemDoNotSpoilEachOthersView) {
  ASSERT_EQ(convert("far.ply", "--translate=500123.4,5412345.3,431.2").exit_code, 0);
  struct Case {
    const char *in, *first, *second;
    bool fits;
  };
  for (const Case& c : {Case{"far.ply", "a.sog", "a.tree", false},  // about its origin, and about 0
                        Case{"ball.ply", "b.sog", "b.ply --translate=100,0,0", false},
                        Case{"ball.ply", "c.spz", "c.tree", true}}) {
    SCOPED_TRACE(c.second);
    const auto convert_to = [&](const std::string& out) {
      return run(fmt::format("convert {} {}", path(c.in), path(out)));
    };
    ASSERT_EQ(convert_to(c.first).exit_code, 0);
    const nlohmann::json before = info(c.first).at("hints");
    const Outcome second = convert_to(c.second);
    EXPECT_EQ(second.exit_code, c.fits ? 0 : 2) << second.out;
    EXPECT_EQ(second.out.find("tells another view, that of") == std::string::npos, c.fits);
    EXPECT_EQ(info(c.first).at("hints"), before);
  }
}

TEST_F(Convert, ALoneGaussianKeepsItsView) {
  GaussianCloud cloud = ball();
  cloud.resize(1, 0);
  for (const float far : {0.0f, 3e6f}) {
    cloud.mean[0] = {far, -far, far};
    save_scene(cloud, path("one.ply"));
    ASSERT_EQ(run(fmt::format("convert {} {}", path("one.ply"), path("one.glb"))).exit_code, 0);
    EXPECT_EQ(info("one.glb").at("hints").at("source"), "sidecar one.json") << far;
    std::filesystem::remove(path("one.json"));
  }
}

TEST_F(Convert, MergesAndRemovesFloaters) {
  for (const char* merge : {"100", "25%"}) {
    const Outcome outcome = convert("merged.ply", fmt::format("--merge {}", merge));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
    EXPECT_THAT(outcome.out,
                AllOf(HasSubstr("100 of 400"), HasSubstr("300 Gaussians were merged")));
  }
  GaussianCloud cloud = ball();
  cloud.mean[7] = {3.0f, 4.0f, 5.0f};
  save_scene(cloud, path("floater.ply"));
  const Outcome outcome =
      run(fmt::format("convert {} {} --remove-floaters", path("floater.ply"), path("clean.ply")));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("399 of 400"), HasSubstr("1 floating")));
  const Outcome tree = convert("merged.tree", "--merge 300");
  ASSERT_EQ(tree.exit_code, 0) << tree.out;
  EXPECT_EQ(info("merged.tree").at("gaussians"), 300);
}

TEST_F(Convert, RefusesEditsThatMakeNoSense) {
  for (const auto& [options, word] : std::initializer_list<std::pair<const char*, const char*>>{
           {"--scale 0", "--scale"},
           {"--scale=-1", "--scale"},
           {"--scale nan", "--scale"},
           {"--rotate 90", "--rotate"},
           {"--rotate=1,2,x", "--rotate"},
           {"--rotate=1,2,3,", "--rotate"},
           {"--translate=1,2,inf", "--translate"},
           {"--translate=1e10,0,0", "--translate"},
           {"--crop=0,0,0,1,1", "--crop"},
           {"--crop=0,0,0,1,0,1", "--crop: y"},
           {"--crop=5,5,5,6,6,6", "--crop"},
           {"--merge 0", "--merge"},
           {"--merge 0%", "--merge"},
           {"--merge 101%", "--merge"},
           {"--merge 0.5", "--merge"},
           {"--merge 9 --keep-fraction 0.5", "--merge"},
           {"--keep-fraction 0", "--keep-fraction"}}) {
    const Outcome outcome = convert("no.ply", options);
    EXPECT_EQ(outcome.exit_code, 2) << options;
    EXPECT_THAT(outcome.out, HasSubstr(word)) << options;
    EXPECT_FALSE(std::filesystem::exists(path("no.ply"))) << options;
  }
  const Outcome tree = convert("no.tree", "--crop=5,5,5,6,6,6");
  EXPECT_EQ(tree.exit_code, 2);
  EXPECT_THAT(tree.out, HasSubstr("--crop"));
  EXPECT_FALSE(std::filesystem::exists(path("no.tree")));
}

TEST_F(Convert, RefusesToWriteOverTheFileOfAFolder) {
  std::filesystem::create_directory(path("hall"));
  std::filesystem::rename(scene(), path("hall/hall.ply"));
  const Outcome outcome =
      run(fmt::format("convert {} {} --merge 10", path("hall"), path("hall/hall.ply")));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.out, HasSubstr("another name"));
}

TEST_F(Convert, LossesOfTheOutputAreTold) {
  const std::string small = "--scale 1e-4";
  EXPECT_THAT(convert("small.spz", small).out,
              HasSubstr("note: 400 of 400 Gaussians are smaller than 4.4e-05"));
  EXPECT_THAT(convert("whole.ply", small).out, Not(HasSubstr("note:")));
  EXPECT_THAT(run("info " + path("small.spz")).out, HasSubstr("does not name its axes"));
  EXPECT_FALSE(load_scene(path("small.spz")).hints.up_is_doubtful) << "the sidecar tells";
  std::filesystem::remove(path("small.json"));
  EXPECT_TRUE(load_scene(path("small.spz")).hints.up_is_doubtful);
}

}  // namespace
}  // namespace catgs::test
