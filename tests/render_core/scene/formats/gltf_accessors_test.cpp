// Accessors, matrices and extensions in the forms that other programs write.
#include <cstdint>
#include <string>
#include <vector>

#include "render_core/scene/activations.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_test_support.h"

namespace catgs::test {
namespace {

using Json = nlohmann::json;

/// Appends bytes to the buffer. The number of their view.
std::size_t add_view(GltfParts& parts, const std::string& bytes) {
  Json& views = parts.json["bufferViews"];
  views.push_back(
      {{"buffer", 0}, {"byteOffset", parts.binary.size()}, {"byteLength", bytes.size()}});
  parts.binary += bytes;
  parts.json["buffers"][0]["byteLength"] = parts.binary.size();
  return views.size() - 1;
}

template <class Index>
Json sparse_rows(GltfParts& parts, const std::vector<Index>& rows, const std::string& values) {
  const std::string indices(reinterpret_cast<const char*>(rows.data()),
                            rows.size() * sizeof(Index));
  return {{"count", rows.size()},
          {"indices",
           {{"bufferView", add_view(parts, indices)},
            {"componentType", sizeof(Index) == 1   ? 5121
                              : sizeof(Index) == 2 ? 5123
                                                   : 5125}}},
          {"values", {{"bufferView", add_view(parts, values)}}}};
}

/// A file whose positions of the Gaussians `rows` are in a sparse accessor.
template <class Index>
std::string with_sparse(const GaussianCloud& cloud, const std::vector<Index>& rows, bool base) {
  GltfParts parts = encode_gltf(cloud);
  std::string values;
  for (const Index row : rows) values += parts.binary.substr(std::size_t{row} * 12, 12);
  for (const Index row : rows) parts.binary.replace(std::size_t{row} * 12, 12, 12, '\x7f');
  Json& accessor = parts.json["accessors"][0];  // of the positions
  accessor["sparse"] = sparse_rows(parts, rows, values);
  if (!base) accessor.erase("bufferView");
  return parts.glb();
}

TEST(Gltf, SparseAccessorsAreRead) {
  const GaussianCloud cloud = random_cloud(9000, 1);
  const auto expect_same = [&](const std::string& bytes) {
    expect_near(cloud, parse_gltf(bytes).cloud, {.rotation_rad = 1e-6f});
  };
  expect_same(with_sparse<std::uint8_t>(cloud, {0, 7, 255}, true));
  expect_same(with_sparse<std::uint16_t>(cloud, {4095, 4096, 8999}, true));
  expect_same(with_sparse<std::uint32_t>(cloud, {1, 4096}, true));

  GaussianCloud mostly_zero = cloud;
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (i != 5 && i != 8999) mostly_zero.mean[i] = glm::vec3(0.0f);
  const GltfFile read = parse_gltf(with_sparse<std::uint32_t>(cloud, {5, 8999}, false));
  expect_near(mostly_zero, read.cloud, {.rotation_rad = 1e-6f});
}

TEST(Gltf, AccessorsWithoutABufferViewAreZeros) {
  const GaussianCloud cloud = random_cloud(300, 1);
  GltfParts parts = encode_gltf(cloud);
  for (const std::size_t accessor : {5, 6, 7})  // the harmonics of degree 1
    parts.json["accessors"][accessor].erase("bufferView");
  const GaussianCloud read = parse_gltf(parts.glb()).cloud;
  EXPECT_EQ(read.mean, cloud.mean);
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read.sh_of(i)[0], cloud.sh_of(i)[0]);
    for (int k = 1; k < 4; ++k) EXPECT_EQ(read.sh_of(i)[k], glm::vec3(0.0f));
  }
}

TEST(Gltf, DraftsWithOtherNamesAreRead) {
  const GaussianCloud cloud = random_cloud(300, 1);
  GltfParts parts = encode_gltf(cloud);
  std::vector<float> colours;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    for (int c = 0; c < 3; ++c) colours.push_back(colour_from_sh(cloud.sh_of(i)[0][c]));
    colours.push_back(cloud.opacity[i]);
  }
  const std::size_t view = add_view(
      parts, {reinterpret_cast<const char*>(colours.data()), colours.size() * sizeof(float)});
  Json& accessors = parts.json["accessors"];
  accessors.push_back(
      {{"bufferView", view}, {"componentType", 5126}, {"count", cloud.size()}, {"type", "VEC4"}});
  Json& primitive = primitive_of(parts.json);
  Json attributes = {{"COLOR_0", accessors.size() - 1}};
  for (const auto& [name, accessor] : primitive["attributes"].items()) {
    const std::string own = name.substr(name.find(':') + 1);
    if (own == name)
      attributes[name] = accessor;
    else if (own != "OPACITY" && own != "SH_DEGREE_0_COEF_0")
      attributes["_" + own] = accessor;
  }
  primitive["attributes"] = attributes;
  Json& extension = primitive["extensions"]["KHR_gaussian_splatting"] = Json::object();
  const GltfFile read = parse_gltf(parts.glb());
  expect_near(cloud, read.cloud, {.rotation_rad = 1e-6f, .opacity = 1e-6f, .sh0 = 1e-6f});
  EXPECT_EQ(read.notes.size(), 1u);
  extension["quantizedPositionScale"] = 13.5;
  EXPECT_THAT(refusal_of([&] { parse_gltf(parts.glb()); }).where,
              ::testing::HasSubstr("quantizedPositionScale"));
}

TEST(Gltf, SparseAccessorsThatCannotBeAreRefused) {
  const GaussianCloud cloud = random_cloud(300, 0);
  const auto where = [](const std::string& bytes) {
    return refusal_of([&] { parse_gltf(bytes); }).where;
  };
  for (const std::vector<std::uint16_t>& rows :
       {std::vector<std::uint16_t>{7, 7}, {9, 7}, {0, 299, 298}})
    EXPECT_EQ(where(with_sparse(cloud, rows, true)), "accessors[0].sparse.indices");
  const auto changed = [&](const char* pointer, const Json& value) {
    GltfParts parts = encode_gltf(cloud);
    const std::vector<std::uint16_t> rows = {1, 2};
    parts.json["accessors"][0]["sparse"] = sparse_rows(parts, rows, std::string(24, '\0'));
    parts.json["accessors"][0]["sparse"][Json::json_pointer(pointer)] = value;
    return where(parts.glb());
  };
  EXPECT_EQ(changed("/count", 301), "accessors[0].sparse.count");
  EXPECT_EQ(changed("/count", 0), "accessors[0].sparse.count");
  EXPECT_EQ(changed("/count", 3), "accessors[0].sparse.indices");
  EXPECT_EQ(changed("/indices/componentType", 5126), "accessors[0].sparse.indices.componentType");
  EXPECT_EQ(changed("/values/byteOffset", 4), "accessors[0].sparse.values");
}

TEST(Gltf, MatricesMayBeRounded) {
  const GaussianCloud cloud = random_cloud(30, 0);
  GltfParts parts = encode_gltf(cloud);
  struct Case {
    std::size_t entry;
    double value;
    bool read;
  };
  for (const Case& c : std::vector<Case>{{3, 1e-16, true},
                                         {7, -1e-12, true},
                                         {11, 1e-3, false},
                                         {15, 1.0 - 1e-16, true},
                                         {15, 0.99999994, true},
                                         {15, 1.001, false}}) {
    parts.json["nodes"][0]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    parts.json["nodes"][0]["matrix"][c.entry] = c.value;
    if (c.read)
      EXPECT_EQ(parse_gltf(parts.glb()).cloud.mean, cloud.mean) << c.value;
    else
      EXPECT_EQ(refusal_of([&] { parse_gltf(parts.glb()); }).where, "nodes[0].matrix") << c.value;
  }
}

TEST(Gltf, FieldsOfExportersTellTheModel) {
  struct Case {
    Json members;
    SplatModel model;
    std::size_t notes;
  };
  for (const Case& c : std::vector<Case>{
           {{{"antialiased", true}}, SplatModel::antialiased, 0},
           {{{"antialiased", false}}, SplatModel::standard, 0},
           {{{"antiAliasing", 1}}, SplatModel::antialiased, 0},
           {{{"splatRenderMode", "mip"}}, SplatModel::antialiased, 0},
           {{{"model", "2dgs"}}, SplatModel::surfels, 0},
           {{{"model", "tomorrow"}}, SplatModel::standard, 1},
           {{{"antialiasing", "a box"}}, SplatModel::standard, 1},
       })
    for (const bool extras : {false, true}) {
      GltfParts parts = encode_gltf(random_cloud(10, 0));
      Json& primitive = primitive_of(parts.json);
      (extras ? primitive["extras"] : primitive["extensions"]["KHR_gaussian_splatting"])
          .update(c.members);
      const GltfFile read = parse_gltf(parts.glb());
      EXPECT_EQ(read.cloud.model, c.model) << c.members;
      EXPECT_EQ(read.notes.size(), c.notes) << c.members;
    }
}

TEST(Gltf, EarlierNamesOfTheSpzExtensionAreKnown) {
  const std::string spz = encode_spz(random_cloud(50, 1), {.version = 2, .coordinate_system = 4});
  const GaussianCloud wanted = parse_gltf(gltf_with_spz(spz).glb()).cloud;
  const Json view = {{"bufferView", 0}};
  for (const char* name :
       {"KHR_spz_compression", "KHR_spz_gaussian_splats_compression",
        "KHR_gaussian_splatting_compression_spz", "KHR_gaussian_splatting_compression_spz_2"})
    for (const Json& extensions :
         std::vector<Json>{{{name, view}},
                           {{"KHR_gaussian_splatting", {{"extensions", {{name, view}}}}}},
                           {{"KHR_gaussian_splatting", Json::object()}, {name, view}}}) {
      GltfParts parts = gltf_with_spz(spz);
      parts.json["extensionsRequired"] = {"KHR_gaussian_splatting", name};
      primitive_of(parts.json)["extensions"] = extensions;
      const GltfFile read = parse_gltf(parts.glb());
      EXPECT_EQ(read.cloud.mean, wanted.mean) << extensions;
      EXPECT_TRUE(read.notes.empty());
    }
}

}  // namespace
}  // namespace catgs::test
