// What a .glb or .gltf may not be.
#include <memory>

#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_test_support.h"

namespace catgs::test {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

/// The error of a file whose JSON was changed.
std::string error_of(const std::function<void(Json&)>& change) {
  GltfParts parts = encode_gltf(random_cloud(300, 1));
  change(parts.json);
  return input_error([&] { parse_gltf(parts.glb()); });
}

TEST(GltfRefusals, ErrorsNameTheField) {
  EXPECT_THAT(error_of([](Json& j) { j["asset"]["version"] = "1.0"; }),
              HasSubstr("scene.glb: asset.version: is not supported"));
  EXPECT_THAT(error_of([](Json& j) { j["extensionsRequired"] = {"EXT_meshopt_compression"}; }),
              HasSubstr("extensionsRequired[0]: 'EXT_meshopt_compression'"));
  EXPECT_THAT(error_of([](Json& j) { j["scene"] = 3; }), HasSubstr("scene: is 3, and there are 1"));
  EXPECT_THAT(error_of([](Json& j) { j["nodes"][0]["mesh"] = 1; }), HasSubstr("nodes[0].mesh"));
  EXPECT_THAT(error_of([](Json& j) {
                j["nodes"][0]["rotation"] = {0, 0, 0, 2};
              }),
              HasSubstr("nodes[0].rotation: is no quaternion"));
  EXPECT_THAT(error_of([](Json& j) {
                j["nodes"][0]["scale"] = {1, 0, 1};
              }),
              HasSubstr("nodes[0]: has a transform without an inverse"));
  EXPECT_THAT(error_of([](Json& j) {
                j["nodes"][0]["matrix"] = {1, 2};
              }),
              HasSubstr("nodes[0].matrix: is not an array of 16 numbers"));
  EXPECT_THAT(error_of([](Json& j) { primitive_of(j)["mode"] = 4; }), HasSubstr("points"));
  EXPECT_THAT(error_of([](Json& j) { primitive_of(j).erase("extensions"); }),
              HasSubstr("holds no Gaussians"));
  EXPECT_THAT(error_of([](Json& j) {
                primitive_of(j)["attributes"].erase("KHR_gaussian_splatting:SH_DEGREE_1_COEF_2");
              }),
              HasSubstr("'KHR_gaussian_splatting:SH_DEGREE_1_COEF_2' is missing"));
  EXPECT_THAT(error_of([](Json& j) {
                primitive_of(j)["attributes"]["KHR_gaussian_splatting:SH_DEGREE_3_COEF_0"] = 4;
              }),
              HasSubstr("degree 3 and not of all below"));
  EXPECT_THAT(error_of([](Json& j) {
                primitive_of(j)["attributes"]["KHR_gaussian_splatting:OPACITY"] = 0;
              }),
              HasSubstr("KHR_gaussian_splatting:OPACITY: is a table of 3 columns"));
  EXPECT_THAT(error_of([](Json& j) { j["accessors"][1]["count"] = 200; }),
              HasSubstr("has 200 rows, and POSITION 300"));
  EXPECT_THAT(error_of([](Json& j) { j["accessors"][2]["sparse"] = Json::object(); }),
              HasSubstr("accessors[2].sparse: is not supported"));
  EXPECT_THAT(error_of([](Json& j) { j["accessors"][2]["componentType"] = 5125; }),
              HasSubstr("accessors[2].componentType"));
  EXPECT_THAT(error_of([](Json& j) { j["accessors"][2]["componentType"] = 5122; }),
              HasSubstr("KHR_gaussian_splatting:SCALE: has a component type"));
}

TEST(GltfRefusals, TablesLieInsideTheirBuffers) {
  const std::uint64_t far = ~std::uint64_t{0} - 3;
  EXPECT_THAT(error_of([](Json& j) { j["accessors"][0]["count"] = 301; }),
              HasSubstr("accessors[0]: takes 3612 bytes from byte 0 on, of 3600"));
  EXPECT_THAT(error_of([](Json& j) { j["accessors"][0]["count"] = std::uint64_t{1} << 29; }),
              HasSubstr("accessors[0].count"));
  EXPECT_THAT(error_of([](Json& j) { j["accessors"][0]["byteOffset"] = 4; }),
              HasSubstr("accessors[0]: takes"));
  EXPECT_THAT(error_of([&](Json& j) { j["accessors"][0]["byteOffset"] = far; }),
              HasSubstr("accessors[0]: takes"));
  EXPECT_THAT(error_of([&](Json& j) { j["bufferViews"][0]["byteOffset"] = far; }),
              HasSubstr("bufferViews[0]: takes"));
  EXPECT_THAT(error_of([&](Json& j) { j["bufferViews"][0]["byteLength"] = far; }),
              HasSubstr("bufferViews[0]: takes"));
  EXPECT_THAT(error_of([](Json& j) { j["bufferViews"][0]["byteStride"] = 4; }),
              HasSubstr("byteStride: is not in 12…252"));
  EXPECT_THAT(error_of([](Json& j) { j["bufferViews"][0]["buffer"] = 7; }),
              HasSubstr("bufferViews[0].buffer: is 7"));
  EXPECT_THAT(error_of([](Json& j) {
                j["buffers"].push_back({{"byteLength", 3600}});
                j["bufferViews"][0]["buffer"] = 1;
              }),
              HasSubstr("buffers[1]: has no uri"));
  for (const char* uri : {"data:,abc", "data:;base64,?"})
    EXPECT_THAT(error_of([&](Json& j) { j["buffers"][0]["uri"] = uri; }),
                HasSubstr("buffers[0].uri: is"));
  EXPECT_THAT(error_of([&](Json& j) { j["buffers"][0]["uri"] = "nowhere.bin"; }),
              HasSubstr("nowhere.bin: is missing"));
}

TEST(GltfRefusals, NodesFormATree) {
  EXPECT_THAT(error_of([](Json& j) { j["nodes"][0]["children"] = {0}; }),
              HasSubstr("nodes[0]: is held by two nodes, or by itself"));
  EXPECT_THAT(error_of([](Json& j) {
                j["scenes"][0]["nodes"] = {0, 0};
              }),
              HasSubstr("is held by two nodes"));
  Json chain;  // as deep as it may be, without a stack
  for (int i = 1; i <= 30'000; ++i) chain.push_back({{"children", {i}}});
  chain.push_back({{"mesh", 0}});
  GltfParts parts = encode_gltf(random_cloud(30, 0));
  parts.json["nodes"] = chain;
  EXPECT_EQ(parse_gltf(parts.glb()).cloud.size(), 30u);
}

TEST(GltfRefusals, MeshesWithoutGaussiansHaveABoundToo) {
  EXPECT_THAT(error_of([](Json& j) {
                const Json primitives(1000, Json::object());
                j["meshes"].push_back({{"primitives", primitives}});
                for (std::size_t i = 1; i <= 100; ++i) {
                  j["nodes"].push_back({{"mesh", 1}});
                  j["scenes"][0]["nodes"].push_back(i);
                }
              }),
              HasSubstr("is one of more than 65536 at nodes"));
}

TEST(GltfRefusals, ASmallFileIsNoLargeScene) {
  // Each use of a mesh is a copy of its Gaussians.
  EXPECT_THAT(error_of([](Json& j) {
                for (std::size_t i = 1; i <= 4096; ++i) {
                  j["nodes"].push_back({{"mesh", 0}});
                  j["scenes"][0]["nodes"].push_back(i);
                }
              }),
              HasSubstr("is one of more than 4096 at nodes"));
  EXPECT_THAT(error_of([](Json& j) {
                for (std::size_t i = 1; i < 1000; ++i) {
                  j["nodes"].push_back({{"mesh", 0}});
                  j["scenes"][0]["nodes"].push_back(i);
                }
              }),
              HasSubstr("300000 Gaussians cannot be in"));
}

TEST(GltfRefusals, DamagedSpzInsideIsRefused) {
  const std::string spz = encode_spz(random_cloud(300, 0), {.version = 3});
  GltfParts parts = gltf_with_spz(spz);
  parts.json["bufferViews"][0]["byteLength"] = spz.size() + 9;
  EXPECT_THAT(input_error([&] { parse_gltf(parts.glb()); }), HasSubstr("bufferViews[0]: takes"));
  parts.json["bufferViews"][0]["byteLength"] = spz.size() / 2;
  EXPECT_THAT(input_error([&] { parse_gltf(parts.glb()); }), HasSubstr("scene.glb"));
  EXPECT_THAT(input_error([&] { parse_gltf(gltf_with_spz("no spz at all").glb()); }),
              HasSubstr("scene.glb"));
  // Each use of a mesh is a copy of its Gaussians.
  parts = gltf_with_spz(spz);
  for (std::size_t i = 1; i < 3000; ++i) {
    parts.json["nodes"].push_back({{"mesh", 0}});
    parts.json["scenes"][0]["nodes"].push_back(i);
  }
  EXPECT_THAT(input_error([&] { parse_gltf(parts.glb()); }), HasSubstr("Gaussians cannot be in"));
}

TEST(GltfRefusals, LargeDocumentsAreRefused) {
  GltfParts parts = encode_gltf(random_cloud(30, 0));
  parts.json["asset"]["extras"] = std::string(16 << 20, 'x');
  EXPECT_THAT(input_error([&] { parse_gltf(parts.glb()); }), HasSubstr("JSON: "));
  EXPECT_THAT(input_error([&] { parse_gltf(parts.json.dump()); }), HasSubstr("at most 16777216"));
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
  EXPECT_THAT(input_error([&] { with(257); }),
              HasSubstr("buffers[257].uri: is of more than 256 buffers"));
}

TEST(GltfRefusals, DamagedBinariesAreRefused) {
  const std::string whole = encode_gltf(random_cloud(300, 0)).glb();
  for (const std::size_t length : {4, 11, 16, 100, 2000, 10'000})
    EXPECT_THAT(input_error([&] { parse_gltf(whole.substr(0, length)); }), HasSubstr("scene.glb"))
        << length;
  const auto with = [&](std::size_t at, char byte) {
    std::string bytes = whole;
    bytes[at] = byte;
    return input_error([&] { parse_gltf(bytes); });
  };
  EXPECT_THAT(with(4, 1), HasSubstr("version 1"));
  EXPECT_THAT(with(15, 127), HasSubstr("cut off"));
  EXPECT_THAT(with(16, 'B'), HasSubstr("holds its JSON"));
}

}  // namespace
}  // namespace catgs::test
