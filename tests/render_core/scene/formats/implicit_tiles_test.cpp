// 3D Tiles whose tiles are listed by subtrees.
#include <cstdint>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/formats/tiles.h"
#include "tests/render_core/scene/formats/gltf_encoder.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using Json = nlohmann::json;

/// A binary subtree.
std::string subtree(const Json& json, const std::string& buffer) {
  const std::string text = json.dump();
  std::string out = "subt";
  append(out, std::uint32_t{1});
  append(out, std::uint64_t{text.size()});
  append(out, std::uint64_t{buffer.size()});
  return out + text + buffer;
}

Json all(int constant) { return {{"constant", constant}}; }
Json bits(int view) { return {{"bitstream", view}}; }

class ImplicitTiles : public FolderTest {
 protected:
  void write_tileset(const Json& implicit, const std::string& content) const {
    const Json root = {{"geometricError", 1},
                       {"refine", "REPLACE"},
                       {"content", {{"uri", content}}},
                       {"implicitTiling", implicit}};
    write("tileset.json", Json{{"asset", {{"version", "1.1"}}}, {"root", root}}.dump());
  }
  void write_tile(const std::string& name, std::size_t count) const {
    write(name, encode_gltf(random_cloud(count, 0)).glb());
  }
  OpenLevels open(std::optional<int> level = {}) const {
    return open_tiles(std::make_shared<FolderFiles>(folder_.path()), "tileset.json", level, {});
  }
  /// Level 0, the tiles 0 and 3 of level 1, and one below the latter. Tile 0 has no content.
  void write_quadtree() const {
    write_tileset({{"subdivisionScheme", "QUADTREE"},
                   {"availableLevels", 3},
                   {"subtreeLevels", 2},
                   {"subtrees", {{"uri", "subtrees/{level}.{x}.{y}.subtree"}}}},
                  "content/{level}/{x}/{y}.glb");
    Json views;
    for (const auto& [offset, bytes] : {std::pair{0, 1}, {1, 1}, {2, 2}})
      views.push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}});
    write("subtrees/0.0.0.subtree", subtree({{"buffers", {{{"byteLength", 4}}}},
                                             {"bufferViews", views},
                                             {"tileAvailability", bits(0)},
                                             {"contentAvailability", {bits(1)}},
                                             {"childSubtreeAvailability", bits(2)}},
                                            std::string("\x13\x11\x00\x20", 4)));
    write("subtrees/2.3.2.subtree", Json{{"tileAvailability", all(1)},
                                         {"contentAvailability", {all(1)}},
                                         {"childSubtreeAvailability", all(0)}}
                                        .dump());
    write_tile("content/0/0/0.glb", 10);
    write_tile("content/1/1/1.glb", 20);
    write_tile("content/2/3/2.glb", 30);
  }
  Refusal refusal() const {
    return refusal_of([this] { open(); });
  }
};

TEST_F(ImplicitTiles, QuadtreesAreRead) {
  write_quadtree();
  EXPECT_EQ(open().levels, 3);
  EXPECT_EQ(open().count, 30u);
  EXPECT_EQ(open(1).count, 20u);
  EXPECT_EQ(open(2).count, 10u);
  EXPECT_EQ(read_levels(open(), two_threads()).mean.size(), 30u);
}

TEST_F(ImplicitTiles, OctreesAreRead) {
  write_tileset({{"subdivisionScheme", "OCTREE"},
                 {"availableLevels", 2},
                 {"subtreeLevels", 2},
                 {"subtrees", {{"uri", "{level}_{x}_{y}_{z}.json"}}}},
                "{level}_{x}_{y}_{z}.glb");
  write("0_0_0_0.json", Json{{"tileAvailability", all(1)},
                             {"contentAvailability", {all(1)}},
                             {"childSubtreeAvailability", all(0)}}
                            .dump());
  write_tile("0_0_0_0.glb", 100);
  for (std::size_t i = 0; i < 8; ++i)
    write_tile(fmt::format("1_{}_{}_{}.glb", i & 1, i >> 1 & 1, i >> 2), i + 1);
  EXPECT_EQ(open().count, 36u);
  EXPECT_EQ(open(1).count, 100u);
}

TEST_F(ImplicitTiles, MistakesAreRefused) {
  const auto path = [this](const char* name) { return (folder_ / name).string(); };
  write_quadtree();
  std::filesystem::remove(folder_ / "subtrees/2.3.2.subtree");
  EXPECT_EQ(refusal().source, path("subtrees/2.3.2.subtree"));
  const Json sound = {{"tileAvailability", all(1)},
                      {"contentAvailability", {all(0)}},
                      {"childSubtreeAvailability", all(0)},
                      {"buffers", {{{"byteLength", 1}}}},
                      {"bufferViews", {{{"buffer", 0}, {"byteLength", 1}}}}};
  struct Case {
    const char* pointer;
    Json value;
    const char* where;
  };
  for (const Case& c : std::vector<Case>{
           {"/tileAvailability", Json::object(), "tileAvailability"},
           {"/tileAvailability", bits(1), "tileAvailability.bitstream"},
           {"/childSubtreeAvailability", bits(0), "bufferViews[0]"},  // 16 bits
           {"/bufferViews/0/buffer", 1, "bufferViews[0].buffer"},
           {"/bufferViews/0/byteOffset", 1'000'000, "bufferViews[0]"},
       }) {
    Json json = sound;
    json["tileAvailability"] = bits(0);
    json[Json::json_pointer(c.pointer)] = c.value;
    write("subtrees/0.0.0.subtree", subtree(json, "\x01"));
    EXPECT_EQ(refusal(), (Refusal{path("subtrees/0.0.0.subtree"), c.where})) << c.value;
  }
  const std::string whole = subtree(sound, "");
  for (std::size_t length = 0; length < whole.size(); length += 7) {
    write("subtrees/0.0.0.subtree", whole.substr(0, length));
    EXPECT_EQ(refusal().source, path("subtrees/0.0.0.subtree")) << length;
  }
  for (const auto& [levels, where] : {std::pair{0, "root.implicitTiling.subtreeLevels"},
                                      {12, "root.implicitTiling.subtreeLevels"}}) {
    write_tileset({{"subdivisionScheme", "QUADTREE"},
                   {"availableLevels", 3},
                   {"subtreeLevels", levels},
                   {"subtrees", {{"uri", "a.subtree"}}}},
                  "a.glb");
    EXPECT_EQ(refusal(), (Refusal{path("tileset.json"), where}));
  }
}

TEST_F(ImplicitTiles, AFewBytesStandForABoundedNumberOfTiles) {
  write_tileset({{"subdivisionScheme", "QUADTREE"},
                 {"availableLevels", 30},
                 {"subtreeLevels", 10},
                 {"subtrees", {{"uri", "a{level}.json"}}}},
                "a.glb");
  write("a0.json", Json{{"tileAvailability", all(1)},
                        {"contentAvailability", {all(0)}},
                        {"childSubtreeAvailability", all(1)}}
                       .dump());
  EXPECT_EQ(refusal(), (Refusal{(folder_ / "tileset.json").string(), "root"}));
}

}  // namespace
}  // namespace catgs::test
