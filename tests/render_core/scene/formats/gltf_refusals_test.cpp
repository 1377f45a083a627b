// What a .glb or .gltf may not be.
#include <functional>
#include <memory>
#include <vector>

#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_test_support.h"
#include "tests/render_core/scene/formats/json_refusals.h"

namespace catgs::test {
namespace {

using Json = nlohmann::json;

/// Each change of the JSON of a sound file must be refused.
void expect_refused(const std::vector<JsonRefusal>& refusals) {
  GltfParts parts = encode_gltf(random_cloud(300, 1));
  const Json sound = parts.json;
  const auto read = [&](const Json& json) {
    parts.json = json;
    parse_gltf(parts.glb());
  };
  expect_refused(sound, "scene.glb", read, refusals);
}

/// What is refused of a file whose JSON was changed.
Refusal refusal_with(const std::function<void(Json&)>& change) {
  GltfParts parts = encode_gltf(random_cloud(300, 1));
  change(parts.json);
  return refusal_of([&] { parse_gltf(parts.glb()); });
}

TEST(GltfRefusals, ErrorsNameTheField) {
  const std::string primitive = "/meshes/0/primitives/0", gaussian = "KHR_gaussian_splatting:";
  const std::string attribute = primitive + "/attributes/" + gaussian;
  const std::string at = "meshes[0].primitives[0]", at_attributes = at + ".attributes";
  expect_refused({
      {"/asset/version", "1.0", "asset.version"},
      {"/extensionsRequired", Json::array({"EXT_meshopt_compression"}), "extensionsRequired[0]"},
      {"/scene", 3, "scene"},
      {"/nodes/0/mesh", 1, "nodes[0].mesh"},
      {"/nodes/0/rotation", {0, 0, 0, 2}, "nodes[0].rotation"},
      {"/nodes/0/scale", {1, 0, 1}, "nodes[0]"},
      {"/nodes/0/matrix", {1, 2}, "nodes[0].matrix"},
      {primitive + "/mode", 4, at},
      {primitive + "/extensions", removed, ""},
      {attribute + "SH_DEGREE_1_COEF_2", removed, at_attributes},
      {attribute + "SH_DEGREE_3_COEF_0", 4, at_attributes},
      {attribute + "OPACITY", 0, at_attributes + "." + gaussian + "OPACITY"},
      {"/accessors/1/count", 200, at_attributes + "." + gaussian + "ROTATION"},
      {"/accessors/2/sparse", Json::object(), "accessors[2].sparse"},
      {"/accessors/2/componentType", 5125, "accessors[2].componentType"},
      {"/accessors/2/componentType", 5122, at_attributes + "." + gaussian + "SCALE"},
  });
}

TEST(GltfRefusals, TablesLieInsideTheirBuffers) {
  const std::uint64_t far = ~std::uint64_t{0} - 3;
  expect_refused({
      {"/accessors/0/count", 301, "accessors[0]"},
      {"/accessors/0/count", std::uint64_t{1} << 29, "accessors[0].count"},
      {"/accessors/0/byteOffset", 4, "accessors[0]"},
      {"/accessors/0/byteOffset", far, "accessors[0]"},
      {"/bufferViews/0/byteOffset", far, "bufferViews[0]"},
      {"/bufferViews/0/byteLength", far, "bufferViews[0]"},
      {"/bufferViews/0/byteStride", 4, "bufferViews[0].byteStride"},
      {"/bufferViews/0/buffer", 7, "bufferViews[0].buffer"},
      {"/buffers/0/uri", "data:,abc", "buffers[0].uri"},
      {"/buffers/0/uri", "data:;base64,?", "buffers[0].uri"},
      {"/buffers/0/uri", "nowhere.bin", "", "nowhere.bin"},
  });
  EXPECT_EQ(refusal_with([](Json& j) {
              j["buffers"].push_back({{"byteLength", 3600}});
              j["bufferViews"][0]["buffer"] = 1;
            }),
            (Refusal{"scene.glb", "buffers[1]"}));
}

TEST(GltfRefusals, NodesFormATree) {
  expect_refused({{"/nodes/0/children", Json::array({0}), "nodes[0]"},
                  {"/scenes/0/nodes", {0, 0}, "nodes[0]"}});
  Json chain;  // as deep as it may be, without a stack
  for (int i = 1; i <= 30'000; ++i) chain.push_back({{"children", {i}}});
  chain.push_back({{"mesh", 0}});
  GltfParts parts = encode_gltf(random_cloud(30, 0));
  parts.json["nodes"] = chain;
  EXPECT_EQ(parse_gltf(parts.glb()).cloud.size(), 30u);
}

TEST(GltfRefusals, MeshesWithoutGaussiansHaveABoundToo) {
  EXPECT_EQ(refusal_with([](Json& j) {
              const Json primitives(1000, Json::object());
              j["meshes"].push_back({{"primitives", primitives}});
              for (std::size_t i = 1; i <= 100; ++i) {
                j["nodes"].push_back({{"mesh", 1}});
                j["scenes"][0]["nodes"].push_back(i);
              }
            }),
            (Refusal{"scene.glb", "meshes[1].primitives[535]"}));
}

TEST(GltfRefusals, ASmallFileIsNoLargeScene) {
  // Each use of a mesh is a copy of its Gaussians.
  const auto with_uses = [](std::size_t uses) {
    return refusal_with([uses](Json& j) {
      for (std::size_t i = 1; i < uses; ++i) {
        j["nodes"].push_back({{"mesh", 0}});
        j["scenes"][0]["nodes"].push_back(i);
      }
    });
  };
  EXPECT_EQ(with_uses(4097), (Refusal{"scene.glb", "meshes[0].primitives[0]"}));
  EXPECT_EQ(with_uses(1000), (Refusal{"scene.glb", "scene"}));
}

TEST(GltfRefusals, DamagedSpzInsideIsRefused) {
  const std::string spz = encode_spz(random_cloud(300, 0), {.version = 3});
  GltfParts parts = gltf_with_spz(spz);
  parts.json["bufferViews"][0]["byteLength"] = spz.size() + 9;
  const auto refusal = [&] { return refusal_of([&] { parse_gltf(parts.glb()); }); };
  EXPECT_EQ(refusal(), (Refusal{"scene.glb", "bufferViews[0]"}));
  parts.json["bufferViews"][0]["byteLength"] = spz.size() / 2;
  EXPECT_EQ(refusal().source, "scene.glb");
  parts = gltf_with_spz("no spz at all");
  EXPECT_EQ(refusal().source, "scene.glb");
  // Each use of a mesh is a copy of its Gaussians.
  parts = gltf_with_spz(spz);
  for (std::size_t i = 1; i < 3000; ++i) {
    parts.json["nodes"].push_back({{"mesh", 0}});
    parts.json["scenes"][0]["nodes"].push_back(i);
  }
  EXPECT_EQ(refusal(), (Refusal{"scene.glb", "scene"}));
}

TEST(GltfRefusals, LargeDocumentsAreRefused) {
  GltfParts parts = encode_gltf(random_cloud(30, 0));
  parts.json["asset"]["extras"] = std::string(16 << 20, 'x');
  EXPECT_EQ(refusal_of([&] { parse_gltf(parts.glb()); }), (Refusal{"scene.glb", "JSON"}));
  EXPECT_EQ(refusal_of([&] { parse_gltf(parts.json.dump()); }), (Refusal{"scene.glb", ""}));
}

/// A folder whose every file has the same content.
class AnyFile final : public FileSet {
 public:
  explicit AnyFile(std::string content) : content_(std::move(content)) {}
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override {
    return std::make_unique<MemorySource>(name, bytes_of(content_));
  }

 private:
  const std::string content_;
};

TEST(GltfRefusals, ManyBuffersAreRefused) {
  const auto with = [](std::size_t buffers) {
    GltfParts parts = encode_gltf(random_cloud(3, 0));
    Json& json = parts.json;
    for (std::size_t i = 1; i <= buffers; ++i) {
      json["buffers"].push_back({{"uri", std::to_string(i)}});
      Json view = json["bufferViews"][0], accessor = json["accessors"][0];
      Json primitive = primitive_of(json);
      view["buffer"] = i;
      accessor["bufferView"] = json["bufferViews"].size();
      primitive["attributes"]["POSITION"] = json["accessors"].size();
      json["bufferViews"].push_back(view);
      json["accessors"].push_back(accessor);
      json["meshes"][0]["primitives"].push_back(primitive);
    }
    return parse_gltf(parts.glb(), AnyFile(parts.binary)).cloud.size();
  };
  EXPECT_EQ(with(256), 3u * 257);
  EXPECT_EQ(refusal_of([&] { with(257); }), (Refusal{"scene.glb", "buffers[257].uri"}));
}

TEST(GltfRefusals, DamagedBinariesAreRefused) {
  const std::string whole = encode_gltf(random_cloud(300, 0)).glb();
  for (const std::size_t length : {4, 11, 16, 100, 2000, 10'000})
    EXPECT_EQ(refusal_of([&] { parse_gltf(whole.substr(0, length)); }).source, "scene.glb")
        << length;
  const auto with = [&](std::size_t at, char byte) {
    std::string bytes = whole;
    bytes[at] = byte;
    return refusal_of([&] { parse_gltf(bytes); });
  };
  EXPECT_EQ(with(4, 1), (Refusal{"scene.glb", "byte 4"}));
  EXPECT_EQ(with(15, 127), (Refusal{"scene.glb", "byte 12"}));
  EXPECT_EQ(with(16, 'B'), (Refusal{"scene.glb", "byte 12"}));
}

}  // namespace
}  // namespace catgs::test
