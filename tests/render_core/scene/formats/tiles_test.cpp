#include "render_core/scene/formats/tiles.h"

#include <memory>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/scene_size.h"
#include "render_core/scene/transform.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_encoder.h"
#include "tests/render_core/scene/formats/json_refusals.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/picked.h"

namespace catgs::test {
namespace {

using Json = nlohmann::json;

Json tile(const std::string& content, const std::string& refine = "REPLACE",
          std::vector<Json> children = {}) {
  Json tile = {{"geometricError", 1}, {"refine", refine}, {"content", {{"uri", content}}}};
  if (!children.empty()) tile["children"] = std::move(children);
  return tile;
}

/// A Gaussian at this place of the glTF.
std::string gltf_at(const glm::vec3& position) {
  GaussianCloud cloud = random_cloud(1, 0);
  cloud.mean[0] = {-position.x, -position.y, position.z};
  return encode_gltf(cloud).glb();
}

class TilesTest : public FolderTest {
 protected:
  static Json tileset(const Json& root) {
    return {{"asset", {{"version", "1.1"}}}, {"geometricError", 9}, {"root", root}};
  }
  void write_tileset(const Json& root, const std::string& name = "tileset.json") const {
    write(name, tileset(root).dump());
  }
  void write_tile(const std::string& name, std::size_t count, int degree = 0) const {
    write(name, encode_gltf(random_cloud(count, degree, static_cast<unsigned>(count))).glb());
  }
  OpenLevels open(std::optional<int> level = {}, std::optional<std::size_t> budget = {}) const {
    return open_tiles(std::make_shared<FolderFiles>(folder_.path()), "tileset.json", level, budget);
  }
  GaussianCloud read() const { return read_levels(open(), two_threads()); }
  Refusal refusal() const {
    return refusal_of([&] { read(); });
  }
  std::string path_of(const std::string& name) const { return (folder_ / name).string(); }
  void expect_at(const glm::vec3& wanted, float tolerance = 1e-5f) const {
    const GaussianCloud cloud = read();
    ASSERT_EQ(cloud.size(), 1u);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(cloud.mean[0][k], wanted[k], tolerance);
  }
};

TEST_F(TilesTest, ChildrenReplaceOrAdd) {
  write_tile("a.glb", 10, 1);
  write_tile("b.glb", 30, 1);
  write_tile("c.glb", 20, 1);
  write_tile("d.glb", 40, 2);
  write_tile("e.glb", 50, 1);
  write_tileset(tile("a.glb", "REPLACE",
                     {tile("b.glb"), tile("c.glb", "REPLACE", {tile("d.glb"), tile("e.glb")})}));
  EXPECT_EQ(open().levels, 3);
  EXPECT_EQ(open().count, 30u + 40 + 50);
  EXPECT_EQ(open().format, "3D Tiles (level 0 of 0…2)");
  EXPECT_EQ(open(1).count, 30u + 20);
  EXPECT_EQ(open(2).count, 10u);
  EXPECT_EQ(refusal_of([&] { open(3); }), (Refusal{path_of("tileset.json"), "level of detail"}));
  const GaussianCloud cloud = read();
  EXPECT_EQ(cloud.size(), 120u);
  EXPECT_EQ(cloud.sh_degree, 2);
  EXPECT_EQ(cloud.sh_of(0)[4], glm::vec3(0.0f));   // of b, whose degree is 1
  EXPECT_NE(cloud.sh_of(30)[4], glm::vec3(0.0f));  // of d

  write_tileset(
      tile("a.glb", "ADD", {tile("b.glb"), tile("c.glb", "ADD", {tile("d.glb"), tile("e.glb")})}));
  EXPECT_EQ(open().count, 150u);
  EXPECT_EQ(open(1).count, 10u + 30 + 20);
  EXPECT_EQ(open(2).count, 10u);
}

TEST_F(TilesTest, ABudgetTakesTheFinestTilesThatFit) {
  for (const std::size_t count : {10, 20, 21, 25, 300})
    write_tile(fmt::format("{}.glb", count), count);
  write_tileset(tile(
      "10.glb", "REPLACE",
      {tile("20.glb", "REPLACE", {tile("25.glb")}), tile("21.glb", "REPLACE", {tile("300.glb")})}));
  EXPECT_EQ(open({}, 400).count, 325u);
  EXPECT_EQ(open({}, 324).count, 25u + 21);  // only one of the two fits
  EXPECT_EQ(open({}, 324).format, "3D Tiles (levels 0 and 1 of 0…2)");
  EXPECT_EQ(open({}, 46).count, 46u);
  EXPECT_EQ(open({}, 45).count, 41u);
  EXPECT_EQ(open({}, 40).count, 10u);
  EXPECT_EQ(open({}, 40).format, "3D Tiles (level 2 of 0…2)");
  EXPECT_EQ(refusal_of([&] { open({}, 9); }),
            (Refusal{path_of("tileset.json"), "Gaussian budget"}));
  EXPECT_EQ(refusal_of([&] { open(0, 99); }), (Refusal{path_of("tileset.json"), ""}));
}

TEST_F(TilesTest, ContentsHaveYUpAndTilesZUp) {
  write("a.glb", gltf_at({1, 2, 3}));
  write_tileset(tile("a.glb"));
  expect_at({1, -2, -3});  // z up: 1, -3, 2
  // A quarter turn about z, then a step.
  Json root = tile("a.glb");
  root["transform"] = {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 10, 20, 30, 1};
  write_tileset(root);
  expect_at({13, -32, 21});  // 3, 1, 2 and then 13, 21, 32
  // The child is moved first.
  Json child = tile("a.glb");
  child["transform"] = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 1, 0, 0, 1};
  root = {{"refine", "ADD"}, {"transform", root["transform"]}, {"children", Json::array({child})}};
  write_tileset(root);
  expect_at({16, -34, 23});  // 3, -6, 4 and then 16, 23, 34
}

TEST_F(TilesTest, GaussiansTurnWithTheirTile) {
  const GaussianCloud cloud = random_cloud(300, 3);
  write("a.glb", encode_gltf(cloud).glb());
  write_tileset(tile("a.glb"));
  GaussianCloud wanted = cloud;
  const CloudTransform half_turn({{-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0}, {}});
  for (std::size_t i = 0; i < wanted.size(); ++i) half_turn.apply(wanted, i);
  expect_near(wanted, read(),
              {.mean = 1e-5f, .rotation_rad = 1e-5f, .sh1 = 1e-5f, .sh_rest = 1e-5f});
}

// East, north, up at 13.4° east, 52.5° north, 40 m, as CesiumJS has it.
TEST_F(TilesTest, ASceneOnTheGlobeGetsAnOriginOfItsOwn) {
  write("a.glb", gltf_at({10, 30, -20}));  // z up: 10 east, 20 north, 30 up
  const Json placed = Json::parse(R"([
    -0.23174790349415736, 0.9727758782093966, 0, 0,
    -0.7717550043949526, -0.183857976216342, 0.6087614128482337, 0,
    0.5921884180034336, 0.14107918115571935, 0.7933533526916126, 0,
    3785065.213730954, 901729.7278027222, 5036896.318965811, 1])");
  Json root = tile("a.glb");
  root["transform"] = placed;
  root["boundingVolume"]["sphere"] = {0, 0, 0, 50};
  write_tileset(root);
  expect_at({10, -30, 20}, 2e-3f);
  EXPECT_EQ(open().notes.size(), 1u);
  root["boundingVolume"] = {{"box", {10, 20, 30, 9, 0, 0, 0, 9, 0, 0, 0, 9}}};
  write_tileset(root);
  expect_at({0, 0, 0}, 2e-3f);
  constexpr double east = 13.4 / 180 * 3.141592653589793, north = 52.5 / 180 * 3.141592653589793;
  root["boundingVolume"] = {{"region", {east, north, east, north, 30, 50}}};
  write_tileset(root);
  expect_at({10, -30, 20}, 2e-3f);
  // The transform may lie on a child, too.
  write_tileset({{"boundingVolume", root["boundingVolume"]}, {"children", Json::array({root})}});
  expect_at({10, -30, 20}, 2e-3f);
}

TEST_F(TilesTest, AFarSceneThatIsNotOnTheGlobeIsMovedAlone) {
  write("a.glb", gltf_at({400'010, 1, -5'000'020}));
  Json root = tile("a.glb");
  root["boundingVolume"]["sphere"] = {400'000, 5'000'000, 0, 50};
  write_tileset(root);
  expect_at({10, -1, 20}, 0.5f);  // the glTF has floats
  EXPECT_EQ(open().notes, std::vector<std::string>{
                              "its origin is [400000.000, 5000000.000, 0.000] of the tileset"});
}

TEST_F(TilesTest, TilesetsHoldTilesets) {
  write("tiles/a.glb", gltf_at({1, 0, 0}));
  write("tiles/more/b.glb", gltf_at({2, 0, 0}));
  Json inner = tile("../a.glb?v=1", "REPLACE", {tile("b.glb")});
  inner["transform"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1};
  write_tileset(inner, "tiles/more/tiles.json");
  Json outer = {{"transform", inner["transform"]}, {"content", {{"url", "tiles/more/tiles.json"}}}};
  write_tileset(outer);
  EXPECT_EQ(open().levels, 2);
  expect_at({12, 0, 0});
  const Scene scene = load_scene(folder_ / "tileset.json");
  EXPECT_EQ(scene.name, folder_.path().filename().string());
  LoadOptions coarse;
  coarse.lod = 1;
  EXPECT_EQ(load_scene(folder_.path(), coarse).cloud.mean[0].x, 11.0f);
  EXPECT_EQ(read_scene_size(locate_scene(folder_.path())).gaussians, 1u);
}

TEST_F(TilesTest, SeveralContentsOfATileAreOneLevel) {
  write_tile("a.glb", 10);
  write("b.glb", gltf_with_spz(encode_spz(random_cloud(20, 1), {.version = 2})).glb());
  GltfParts parts = encode_gltf(random_cloud(30, 0));
  write("c.bin", parts.binary);
  parts.json["buffers"][0]["uri"] = "c.bin";
  write("c.gltf", parts.json.dump());
  write_tileset({{"contents", {{{"uri", "a.glb"}}, {{"uri", "b.glb"}}, {{"uri", "c.gltf"}}}}});
  EXPECT_EQ(open().levels, 1);
  EXPECT_EQ(open().parts, 3u);
  EXPECT_EQ(read().size(), 60u);
  EXPECT_EQ(read().sh_degree, 1);
}

TEST_F(TilesTest, ErrorsNameTheField) {
  write_tile("a.glb", 5);
  const auto expect_all = [&](const std::vector<JsonRefusal>& refusals) {
    const auto read_changed = [&](const Json& json) {
      write("tileset.json", json.dump());
      read();
    };
    expect_refused(tileset(tile("a.glb")), path_of("tileset.json"), read_changed, refusals);
  };
  expect_all({
      {"/asset/version", "2.0", "asset.version"},
      {"/extensionsRequired", Json::array({"3DTILES_implicit_tiling"}), "extensionsRequired[0]"},
      {"/root/implicitTiling", Json::object(), "root.implicitTiling"},
      {"/root/refine", "SPLIT", "root.refine"},
      {"/root/transform", {1, 2}, "root.transform"},
      {"/root/transform", {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1}, "root.transform"},
      {"/root/transform", {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1}, "root"},
      {"/root/content", Json::object(), "root.content"},
      {"/root/content/uri", std::string(5000, 'a'), "root.content.uri"},
      {"/root/content/uri", "missing.glb", "", path_of("missing.glb")},
      {"/root/content", removed, "root"},
  });
  for (const char* old : {"b3dm", "pnts", "cmpt", "i3dm"}) {
    write("old.b3dm", std::string(old) + std::string(100, '\0'));
    expect_all({{"/root/content/uri", "old.b3dm", "", path_of("old.b3dm")}});
  }
}

TEST_F(TilesTest, NoNameLeadsOut) {
  write_tile("a.glb", 5);
  write_tileset(tile("a.glb"), "scene/tileset.json");
  const auto read_changed = [&](const Json& json) {
    write("scene/tileset.json", json.dump());
    load_scene(folder_ / "scene");
  };
  const std::string uri = "/root/content/uri", folder = path_of("scene");
  expect_refused(tileset(tile("a.glb")), path_of("scene/tileset.json"), read_changed,
                 {{uri, "../a.glb", "file name '../a.glb'", folder},
                  {uri, "%2e%2e/a.glb", "file name '../a.glb'", folder},
                  {uri, "x/../../a.glb", "file name '../a.glb'", folder},
                  {uri, "/etc/passwd", "file name '/etc/passwd'", folder},
                  {uri, "a%00.glb", "file name 'a\\x00.glb'", folder},
                  {uri, "http://host/a.glb", "root.content.uri"},
                  {uri, "data:,x", "root.content.uri"},
                  {uri, "", "file name ''", folder}});
}

TEST_F(TilesTest, NoFileIsUsedTwice) {
  write_tile("a.glb", 5);
  write_tileset(tile("a.glb", "ADD", {tile("x/../a.glb")}));
  EXPECT_EQ(refusal(), (Refusal{path_of("tileset.json"), "file a.glb"}));
  write_tileset(tile("a.glb", "ADD", {tile("tileset.json")}));
  EXPECT_EQ(refusal(), (Refusal{path_of("tileset.json"), "file tileset.json"}));
}

TEST_F(TilesTest, DepthsAndNumbersHaveBounds) {
  Json deep = tile("a.glb");
  for (int i = 0; i < 70; ++i) deep = {{"refine", "ADD"}, {"children", Json::array({deep})}};
  write_tile("a.glb", 5);
  write_tileset(deep);
  EXPECT_THAT(refusal().where, ::testing::MatchesRegex(R"(root(\.children\[0\])+)"));

  for (int i = 0; i < 17; ++i)
    write_tileset(tile(fmt::format("{}.json", i + 1)), fmt::format("{}.json", i));
  write_tileset(tile("0.json"));
  EXPECT_EQ(refusal(), (Refusal{path_of("15.json"), ""}));

  std::vector<Json> many(65'536, Json::object());
  write_tileset({{"children", many}});
  EXPECT_EQ(refusal(), (Refusal{path_of("tileset.json"), "root.children[65535]"}));

  write("tileset.json", std::string((32 << 20) + 1, ' '));
  EXPECT_EQ(refusal(), (Refusal{path_of("tileset.json"), ""}));
}

TEST_F(TilesTest, ManySmallFilesMakeNoHugeScene) {
  // Each alone is let pass.
  const GaussianCloud same = picked(random_cloud(1, 0), std::vector<std::uint32_t>(60'000));
  const std::string spz = encode_spz(same, {.version = 2});
  std::vector<Json> children;
  for (int i = 0; i < 20; ++i) {
    write(fmt::format("{}.glb", i), gltf_with_spz(spz).glb());
    children.push_back(tile(fmt::format("{}.glb", i)));
  }
  write_tileset({{"children", children}});
  EXPECT_EQ(refusal(), (Refusal{path_of("tileset.json"), "root"}));
}

TEST_F(TilesTest, AFileThatChangesWhileItIsReadIsRefused) {
  write_tile("a.glb", 10);
  write_tileset(tile("a.glb"));
  const OpenLevels scene = open();
  write_tile("a.glb", 11);
  EXPECT_EQ(refusal_of([&] { read_levels(scene, two_threads()); }),
            (Refusal{path_of("a.glb"), ""}));
}

}  // namespace
}  // namespace catgs::test
