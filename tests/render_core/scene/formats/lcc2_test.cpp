#include "render_core/scene/formats/lcc2.h"

#include <memory>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/scene_size.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/spz.h"
#include "render_core/scene/transform.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/json_refusals.h"

namespace catgs::test {
namespace {

using ::testing::ElementsAre;

using Json = nlohmann::json;

Json node(std::size_t file, std::size_t start, std::size_t count, const Json& children = {}) {
  Json node = {{"childNum", children.size()},
               {"data", {{"3dgs", {{"name", file}, {"start", start}, {"count", count}}}}}};
  for (std::size_t i = 0; i < children.size(); ++i) node["child"][std::to_string(i)] = children[i];
  return node;
}

/// Right, down, front of a cloud with z up.
void stand_up(GaussianCloud& cloud) {
  const CloudTransform transform({{1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0}, {}});
  for (std::size_t i = 0; i < cloud.size(); ++i) transform.apply(cloud, i);
}

/// Two regions: the second one has two levels below its coarsest one.
class Lcc2Test : public FolderTest {
 protected:
  void SetUp() override { use(".sog"); }

  void use(const std::string& extension) {
    extension_ = extension;
    write_chunk("0", 90, 1);   // level 2 of both
    write_chunk("1", 300, 2);  // level 1
    write_chunk("2", 500, 1);  // level 0
    write_chunk("env", 7, 0);
    const Json fine = node(1, 100, 200, Json::array({node(2, 0, 400), node(2, 400, 100)}));
    scene_ = {{"version", "0.0.3"}, {"splatType", extension}, {"totalLevels", 3}};
    scene_["root"] = {{"splatFiles", Json::array()}, {"childNum", 2}};
    for (const char* name : {"0", "1", "2", "env"})
      scene_["root"]["splatFiles"].push_back("data/3dgs/" + std::string(name) + extension);
    scene_["root"]["child"]["0"] = node(0, 0, 40, Json::array({node(1, 0, 100)}));
    scene_["root"]["child"]["1"] = node(0, 40, 50, Json::array({fine}));
  }

  void write_chunk(const std::string& name, std::size_t count, int degree) {
    GaussianCloud& cloud = clouds_[name];
    const std::string path = "data/3dgs/" + name + extension_;
    cloud = random_cloud(count, degree, static_cast<unsigned>(count));
    if (extension_ == ".sog") {
      write(path, zip(encode_sog(cloud, 2)));
      cloud = read_sog(ZipFiles(FileSource(folder_ / path)), "meta.json", two_threads()).cloud;
    } else {
      write(path, encode_spz(cloud, {.version = 4, .coordinate_system = 4}));
      cloud = read_spz(FileSource(folder_ / path), two_threads(), SpzAxes::as_stored).cloud;
    }
    stand_up(cloud);
  }

  OpenLevels open(std::optional<int> level = {}, std::optional<std::size_t> budget = {}) {
    write("hall.lcc2", scene_.dump());
    return open_lcc2(std::make_shared<FolderFiles>(folder_.path()), "hall.lcc2", level, budget);
  }
  /// Each change of the .lcc2 must be refused.
  void expect_all(const std::vector<JsonRefusal>& refusals) {
    const auto open_changed = [&](const Json& scene) {
      scene_ = scene;
      open();
    };
    const Json sound = scene_;
    expect_refused(sound, at("").source, open_changed, refusals);
    scene_ = sound;
  }
  /// What an error names that the .lcc2 is refused with.
  Refusal at(const std::string& where) const { return {(folder_ / "hall.lcc2").string(), where}; }

  std::string extension_;
  std::map<std::string, GaussianCloud> clouds_;  // in right, down, front
  Json scene_;
};

TEST_F(Lcc2Test, LeavesAreTheFinestLevel) {
  for (const char* extension : {".sog", ".spz"}) {
    use(extension);
    EXPECT_EQ(open().levels, 3);
    EXPECT_EQ(open().format, "LCC2 (level 0 of 0…2)");
    EXPECT_EQ(open().count, 100u + 500);  // the first region ends at level 1
    EXPECT_EQ(open(1).count, 300u);
    EXPECT_EQ(open(2).count, 90u);
    EXPECT_EQ(open({}, 599).count, 300u);
    EXPECT_EQ(open({}, 250).count, 90u + 60);  // only the first region's next level fits
    EXPECT_EQ(refusal_of([&] { open({}, 89); }), at("Gaussian budget"));
    EXPECT_THAT(open().notes, ElementsAre("LCC2: Data Organization Format originated from XGRIDS"));
  }
}

TEST_F(Lcc2Test, GaussiansStandUp) {
  for (const char* extension : {".sog", ".spz"}) {
    use(extension);
    const GaussianCloud whole = read_levels(open(), two_threads());
    ASSERT_EQ(whole.size(), 600u);
    EXPECT_EQ(whole.sh_degree, 2);
    const GaussianCloud &first = clouds_["1"], &fine = clouds_["2"];
    for (std::size_t i = 0; i < 100; ++i) {
      ASSERT_EQ(whole.mean[i], first.mean[i]);
      ASSERT_EQ(whole.sh_of(i)[8], first.sh_of(i)[8]);
    }
    for (std::size_t i = 0; i < 500; ++i) {
      ASSERT_EQ(whole.mean[100 + i], fine.mean[i]);
      ASSERT_EQ(whole.sh_of(100 + i)[3], fine.sh_of(i)[3]);
      ASSERT_EQ(whole.sh_of(100 + i)[8], glm::vec3(0.0f));
    }
    // From a file's middle.
    const GaussianCloud middle = read_levels(open({}, 250), two_threads());
    EXPECT_EQ(middle.mean[0], clouds_["0"].mean[40]);
    EXPECT_EQ(middle.mean[50], first.mean[0]);
  }
}

TEST_F(Lcc2Test, SurroundingsBelongToEveryLevel) {
  scene_["root"]["data"]["env"]["name"] = 3;
  EXPECT_EQ(open().count, 607u);
  EXPECT_EQ(open(2).count, 97u);
  EXPECT_EQ(open({}, 306).count, 97u + 60);
  EXPECT_EQ(refusal_of([&] { open({}, 96); }), at("Gaussian budget"));
  const GaussianCloud whole = read_levels(open(), two_threads());
  EXPECT_EQ(whole.mean[606], clouds_["env"].mean[6]);
  scene_["root"]["data"] = nullptr;
  EXPECT_EQ(open().count, 600u);
}

TEST_F(Lcc2Test, EarlierNamesOfFieldsAreKnown) {
  Json& root = scene_["root"];
  root.erase("splatFiles");
  root["files"] = {"/data/3dgs/0", "/data/3dgs/1", "/data/3dgs/2.sog"};
  root["child"] = Json::array({root["child"]["0"], root["child"]["1"]});
  scene_.erase("splatType");
  EXPECT_EQ(open().count, 600u);
}

TEST_F(Lcc2Test, ScenesAreFoundByFileAndFolder) {
  open();
  const Scene scene = load_scene(folder_ / "hall.lcc2");
  EXPECT_EQ(scene.name, "hall");
  EXPECT_EQ(scene.format, "LCC2 (level 0 of 0…2)");
  write("hall.json", R"({"near": 0.125})");
  LoadOptions coarse;
  coarse.lod = 2;
  EXPECT_EQ(load_scene(folder_.path(), coarse).hints.near_z, 0.125f);
  EXPECT_EQ(read_scene_size(locate_scene(folder_ / "hall.lcc2"), coarse).gaussians, 90u);
  EXPECT_EQ(read_scene_size(locate_scene(folder_ / "hall.lcc2")).sh_degree, 2);
  std::filesystem::rename(folder_ / "hall.lcc2", folder_ / "meta.lcc2");
  EXPECT_EQ(load_scene(folder_ / "meta.lcc2").name, folder_.path().filename().string());
}

TEST_F(Lcc2Test, ErrorsNameTheField) {
  const std::string first = "/root/child/0/data/3dgs", at_first = "root.child.0.data.3dgs";
  expect_all({
      {"/version", "1.0", "version"},
      {"/splatType", ".ply", "splatType"},
      {"/root", removed, ""},
      {"/root/splatFiles", removed, "root"},
      {"/root/child", removed, "root"},
      {first + "/name", 4, at_first + ".name"},
      {"/root/data/env/name", -1, "root.data.env.name"},
      {first + "/start", 1ull << 60, at_first},
  });
}

TEST_F(Lcc2Test, RangesAreThereAndDoNotOverlap) {
  const std::string fine = "/root/child/1/child/0/child/1/data/3dgs";
  expect_all({{fine + "/count", 101, "root"}, {fine + "/start", 399, "root"}});
}

TEST_F(Lcc2Test, NoNameLeadsOutAndNoFileIsUsedTwice) {
  const std::string name = "/root/splatFiles/2", folder = folder_.path().string();
  expect_all({
      {name, "../2.sog", "file name '../2.sog'", folder},
      {name, "/etc/passwd", "file name '/etc/passwd'", folder},
      {name, "", "file name ''", folder},
      {name, "data/3dgs/1.sog", "file data/3dgs/1.sog"},
      {"/root/data/env/name", 2, "file data/3dgs/2.sog"},
  });
}

TEST_F(Lcc2Test, DepthsAndNumbersHaveBounds) {
  expect_all({
      {"/root/child", std::vector<Json>(65'536, Json::object()), "root.child[65535]"},
      {"/root/splatFiles", std::vector<std::string>(65'537, "a.sog"), "root.splatFiles"},
      {"/root/splatFiles/0", std::string(5000, 'a'), "root.splatFiles[0]"},
  });
  for (int i = 0; i < 70; ++i) {
    const Json inner = scene_["root"]["child"];
    scene_["root"]["child"] = {{"0", {{"child", inner}}}};
  }
  EXPECT_THAT(refusal_of([&] { open(); }).where, ::testing::MatchesRegex(R"(root(\.child\.0)+)"));
  write("hall.lcc2", std::string((32 << 20) + 1, ' '));
  EXPECT_EQ(refusal_of([&] {
              open_lcc2(std::make_shared<FolderFiles>(folder_.path()), "hall.lcc2", {}, {});
            }),
            at(""));
}

TEST_F(Lcc2Test, AFileThatChangesWhileItIsReadIsRefused) {
  use(".spz");
  const OpenLevels scene = open();
  write("data/3dgs/2.spz", encode_spz(random_cloud(501, 1), {.version = 4}));
  EXPECT_EQ(refusal_of([&] { read_levels(scene, two_threads()); }),
            (Refusal{(folder_ / "data/3dgs/2.spz").string(), ""}));
}

}  // namespace
}  // namespace catgs::test
