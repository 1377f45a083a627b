#include "render_core/scene/formats/gltf.h"

#include <cmath>
#include <sstream>

#include <nlohmann/json.hpp>

#include "render_core/math/spherical_harmonics-inl.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/scene_size.h"
#include "render_core/scene/formats/spz.h"
#include "render_core/scene/transform.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_test_support.h"

namespace catgs::test {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

/// Values that bytes and shorts can stand for.
GaussianCloud storable_cloud(std::size_t count, int sh_degree) {
  GaussianCloud cloud = random_cloud(count, sh_degree);
  for (std::size_t i = 0; i < count; ++i) {
    cloud.mean[i] = glm::clamp(cloud.mean[i] / 16.0f, -1.0f, 1.0f);
    cloud.scale[i] = glm::clamp(10.0f * cloud.scale[i], 0.2f, 1.0f);
  }
  for (glm::vec3& sh : cloud.sh) sh = glm::clamp(sh, -1.0f, 1.0f);
  return cloud;
}

constexpr float quat_angle(float error) { return 2.0f * 2.0f * error; }  // 4 components

TEST(Gltf, FilesAreReadAndTurnedToRightDownFront) {
  struct Case {
    GltfStyle style;
    Tolerance tolerance;
  };
  for (const auto& [style, tolerance] : std::vector<Case>{
           {{}, {.rotation_rad = 1e-6f}},
           {{.interleaved = true}, {.rotation_rad = 1e-6f}},
           {{.position = "short normalized",
           .rotation = "short normalized",
           .scale = "unsigned_short normalized",
           .opacity = "unsigned_short normalized",
           .sh = "short normalized"},
            {.mean = 0.51f / 32767,
            .log_scale = 0.51f / 65535 / 0.2f,
            .rotation_rad = quat_angle(0.51f / 32767),
            .opacity = 0.51f / 65535,
            .sh0 = 0.51f / 32767,
            .sh1 = 0.51f / 32767,
            .sh_rest = 0.51f / 32767}},
           {{.position = "byte normalized",
           .rotation = "byte normalized",
           .scale = "byte normalized",
           .opacity = "unsigned_byte normalized",
           .sh = "byte normalized",
           .interleaved = true},
            {.mean = 0.51f / 127,
            .log_scale = 0.52f / 127 / 0.2f,
            .rotation_rad = quat_angle(0.51f / 127),
            .opacity = 0.51f / 255,
            .sh0 = 0.51f / 127,
            .sh1 = 0.51f / 127,
            .sh_rest = 0.51f / 127}},
       })
    for (const int degree : {0, 1, 2, 3}) {
      SCOPED_TRACE(style.position + ", degree " + std::to_string(degree));
      const GaussianCloud cloud = storable_cloud(5000, degree);
      const GltfFile read = parse_gltf(encode_gltf(cloud, style).glb());
      expect_near(cloud, read.cloud, tolerance);
      EXPECT_TRUE(read.notes.empty());
    }
}

TEST(Gltf, IntegersThatAreNotNormalisedStandForThemselves) {
  GaussianCloud cloud = random_cloud(300, 0);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      cloud.mean[i][k] = std::round(20.0f * cloud.mean[i][k]);
      cloud.scale[i][k] = 1.0f + std::round(20.0f * cloud.opacity[i]);
    }
  for (const char* scale : {"unsigned_byte", "unsigned_short"}) {
    const std::string bytes = encode_gltf(cloud, {.position = "short", .scale = scale}).glb();
    expect_near(cloud, parse_gltf(bytes).cloud, {.rotation_rad = 1e-6f});
  }
}

TEST(Gltf, OpacitiesOfOneAreNoFaults) {
  GaussianCloud cloud = random_cloud(3, 0);
  cloud.opacity[1] = 1.0f;
  EXPECT_EQ(parse_gltf(encode_gltf(cloud).glb()).cloud.opacity[1], max_opacity);
}

TEST(Gltf, WrittenFilesReadBackBitForBit) {
  for (const int degree : {0, 1, 2, 3}) {
    const GaussianCloud cloud = random_cloud(9000, degree);
    std::ostringstream out;
    write_glb(cloud, out);
    const GaussianCloud read = parse_gltf(out.str()).cloud;
    expect_near(cloud, read, {.rotation_rad = 1e-6f});
    EXPECT_EQ(read.rotation, cloud.rotation);
  }
}

TEST(Gltf, WrittenFilesFollowTheSpecification) {
  const GaussianCloud cloud = random_cloud(101, 1);
  std::ostringstream out;
  write_glb(cloud, out);
  const std::string bytes = out.str();
  EXPECT_EQ(load_as<std::uint32_t>(bytes_of(bytes).data() + 8), bytes.size());
  const auto json_size = load_as<std::uint32_t>(bytes_of(bytes).data() + 12);
  EXPECT_EQ(json_size % 4, 0u);
  const Json json = Json::parse(bytes.substr(20, json_size));
  EXPECT_EQ(json["extensionsUsed"], Json::array({"KHR_gaussian_splatting"}));
  const Json& primitive = json["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 0);
  EXPECT_EQ(primitive["extensions"]["KHR_gaussian_splatting"]["kernel"], "ellipse");
  const Json& position = json["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
  float low = 1e9f;
  for (const glm::vec3& mean : cloud.mean) low = std::min(low, -mean.y);
  EXPECT_EQ(position["min"][1].get<float>(), low);
  const Json& colour = json["accessors"][primitive["attributes"]["COLOR_0"].get<std::size_t>()];
  EXPECT_EQ(colour["type"], "VEC4");
  EXPECT_EQ(colour["normalized"], true);
}

/// The same, moved by `map` in glTF's axes.
GaussianCloud moved(GaussianCloud cloud, const AffineMap& map) {
  const AffineMap turn{glm::dmat3(-1, 0, 0, 0, -1, 0, 0, 0, 1), {}};
  const CloudTransform transform(turn * map * turn);
  for (std::size_t i = 0; i < cloud.size(); ++i) transform.apply(cloud, i);
  return cloud;
}

constexpr Tolerance rounding = {.mean = 1e-5f,
                                .log_scale = 1e-5f,
                                .rotation_rad = 0.02f,  // of nearly round Gaussians
                                .opacity = 0.0f,
                                .sh0 = 1e-5f,
                                .sh1 = 1e-5f,
                                .sh_rest = 1e-5f};

TEST(Gltf, NodesMoveTurnAndStretch) {
  const GaussianCloud cloud = random_cloud(500, 3);
  GltfParts parts = encode_gltf(cloud);
  const glm::dquat turn = glm::normalize(glm::dquat(0.3, 0.5, -0.2, 0.7));
  const AffineMap upper{2.0 * glm::mat3_cast(turn), {1.0, -4.0, 2.0}};
  const AffineMap lower{glm::dmat3(1, 0.5, 0, 0, 1, 0.25, 0, 0, 3), {0.5, 0.25, -8.0}};
  parts.json["nodes"] = {
      {{"children", {1}},
       {"translation", {1.0, -4.0, 2.0}},
       {"rotation", {turn.x, turn.y, turn.z, turn.w}},
       {"scale", {2.0, 2.0, 2.0}}},
      {{"mesh", 0}, {"matrix", {1, 0.5, 0, 0, 0, 1, 0.25, 0, 0, 0, 3, 0, 0.5, 0.25, -8, 1}}}};
  expect_near(moved(cloud, upper * lower), parse_gltf(parts.glb()).cloud, rounding);
}

TEST(Gltf, SeveralPrimitivesAndMeshesAreOneScene) {
  const GaussianCloud cloud = random_cloud(200, 1);
  GltfParts parts = encode_gltf(cloud);
  Json plain = parts.json["meshes"][0];  // of degree 0
  auto& attributes = plain["primitives"][0]["attributes"];
  for (const char* name : {"1_COEF_0", "1_COEF_1", "1_COEF_2"})
    attributes.erase(std::string("KHR_gaussian_splatting:SH_DEGREE_") + name);
  plain["primitives"].push_back(plain["primitives"][0]);
  const Json triangles = {{"attributes", {{"POSITION", 0}}}};
  plain["primitives"].push_back(triangles);
  parts.json["meshes"].push_back(plain);
  parts.json["nodes"] = {{{"mesh", 0}}, {{"mesh", 1}, {"translation", {0, 5, 0}}}, {{"mesh", 0}}};
  parts.json["scenes"][0]["nodes"] = {0, 1};  // the third node is not in the scene
  const GltfFile read = parse_gltf(parts.glb());
  ASSERT_EQ(read.cloud.size(), 600u);
  EXPECT_EQ(read.cloud.sh_degree, 1);
  EXPECT_THAT(read.notes, testing::ElementsAre(testing::HasSubstr("meshes")));
  for (const std::size_t i : {0, 77, 199}) {
    EXPECT_EQ(read.cloud.mean[i], cloud.mean[i]);
    EXPECT_EQ(read.cloud.sh_of(i)[2], cloud.sh_of(i)[2]);
    for (const std::size_t copy : {i + 200, i + 400}) {
      EXPECT_LT(glm::distance(read.cloud.mean[copy], cloud.mean[i] - glm::vec3(0, 5, 0)), 1e-5f);
      EXPECT_LT(glm::distance(read.cloud.sh_of(copy)[0], cloud.sh_of(i)[0]), 1e-6f);
      EXPECT_EQ(read.cloud.sh_of(copy)[2], glm::vec3(0.0f));
    }
  }
}

TEST(Gltf, LinearColoursAreEncoded) {
  const auto encoded = [](double v) {
    return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1.0 / 2.4) - 0.055;
  };
  const auto linear = [](const GaussianCloud& cloud) {
    GltfParts parts = encode_gltf(cloud);
    parts.json["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]["colorSpace"] =
        "lin_rec709_display";
    return parse_gltf(parts.glb());
  };
  GaussianCloud cloud = random_cloud(200, 0);
  const GltfFile plain = linear(cloud);
  EXPECT_THAT(plain.notes, testing::ElementsAre(testing::HasSubstr("linear light")));
  for (std::size_t i = 0; i < cloud.size(); ++i)
    EXPECT_NEAR(colour_from_sh(plain.cloud.sh[i].x),
                encoded(std::max(0.0f, colour_from_sh(cloud.sh[i].x))), 1e-5);

  cloud = random_cloud(200, 3);
  for (std::size_t i = 0; i < cloud.sh.size(); ++i) cloud.sh[i] *= i % 16 == 0 ? 0.5f : 0.1f;
  const GltfFile lit = linear(cloud);
  double worst = 0.0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    double basis[16], before = 0.5, after = 0.5;
    const glm::dvec3 d = glm::normalize(glm::dvec3(cloud.mean[i]));
    math::sh_basis<double>({d.x, d.y, d.z}, 3, basis);
    for (int k = 0; k < 16; ++k) {
      before += basis[k] * cloud.sh_of(i)[k].y;
      after += basis[k] * lit.cloud.sh_of(i)[k].y;
    }
    worst = std::max(worst, std::abs(after - encoded(before)));
  }
  EXPECT_LT(worst, 0.01);
}

/// RFC 4648.
std::string base64(const std::string& bytes) {
  constexpr std::string_view alphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? alphabet[bits >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

TEST(Gltf, AnSpzInsideHasTheAxesOfTheGltfAsStored) {
  const GaussianCloud stored = storable_cloud(500, 2);
  // Axes that the .spz names do not count: the number makes the encoder store the cloud as it is.
  for (const std::uint32_t system : {4u, 7u}) {
    const std::string spz = encode_spz(stored, {.version = 2, .coordinate_system = system});
    GltfParts parts = gltf_with_spz(spz);
    parts.json["nodes"][0]["translation"] = {1, 2, 3};
    GaussianCloud wanted =
        read_spz(MemorySource("a.spz", bytes_of(spz)), two_threads(), SpzAxes::as_stored).cloud;
    ASSERT_EQ(wanted.mean[7].y, std::round(stored.mean[7].y * 4096.0f) / 4096.0f);
    const CloudTransform to_right_down_front(
        {{-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0}, {-1.0, -2.0, 3.0}});
    for (std::size_t i = 0; i < wanted.size(); ++i) to_right_down_front.apply(wanted, i);
    const GltfFile read = parse_gltf(parts.glb());
    expect_near(wanted, read.cloud, {.rotation_rad = 1e-5f});
    EXPECT_TRUE(read.notes.empty());
    const std::string bytes = parts.glb();
    const GltfSize size = read_gltf_size(MemorySource("a.glb", bytes_of(bytes)), NoFiles());
    EXPECT_EQ(size.count, 500u);
    EXPECT_EQ(size.sh_degree, 2);
  }
}

TEST(Gltf, AnSpzInsideTellsTheModelAndWhatIsLeftOut) {
  GaussianCloud cloud = storable_cloud(20, 0);
  cloud.model = SplatModel::antialiased;
  std::ostringstream spz;
  write_spz(cloud, spz);
  EXPECT_EQ(parse_gltf(gltf_with_spz(spz.str()).glb()).cloud.model, SplatModel::antialiased);
  const std::string fourth =
      encode_spz(storable_cloud(20, 3), {.version = 3, .extra_sh_degree = 4});
  const GltfFile read = parse_gltf(gltf_with_spz(fourth).glb());
  EXPECT_EQ(read.cloud.sh_degree, 3);
  EXPECT_EQ(read.notes, notes_of_degree(4));
}

class GltfFiles : public FolderTest {};

TEST_F(GltfFiles, BuffersMayBeDataOrLieBeside) {
  const GaussianCloud cloud = random_cloud(300, 1);
  GltfParts parts = encode_gltf(cloud);
  write("bytes and more.bin", parts.binary);
  parts.json["buffers"][0]["uri"] = "bytes%20and%20more.bin";
  const auto path = write("room.gltf", parts.json.dump());
  const Scene scene = load_scene(path);
  EXPECT_EQ(scene.format, "glTF");
  EXPECT_EQ(scene.cloud.mean, cloud.mean);
  EXPECT_EQ(read_scene_size(locate_scene(path)).gaussians, 300u);
  EXPECT_EQ(read_scene_size(locate_scene(path)).sh_degree, 1);

  for (const char* uri : {"../bytes.bin", "%2e%2e/bytes.bin", "/etc/passwd", "a%00.bin", ""}) {
    parts.json["buffers"][0]["uri"] = uri;
    const auto climbing = write("elsewhere/room.gltf", parts.json.dump());
    EXPECT_EQ(refusal_of([&] { load_scene(climbing); }).source, (folder_ / "elsewhere").string());
  }

  GltfParts small = encode_gltf(random_cloud(1, 0));
  small.json["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64(small.binary);
  EXPECT_EQ(parse_gltf(small.json.dump()).cloud.mean, random_cloud(1, 0).mean);
}

TEST_F(GltfFiles, FilesAreKnownByContentOrName) {
  const GaussianCloud cloud = random_cloud(300, 2);
  const Scene scene = load_scene(write("a.ply", encode_gltf(cloud).glb()));
  EXPECT_EQ(scene.format, "glTF");
  EXPECT_EQ(scene.cloud.size(), 300u);
  const SceneSize size = read_scene_size(locate_scene(folder_ / "a.ply"));
  EXPECT_EQ(size.gaussians, 300u);
  EXPECT_EQ(size.sh_degree, 2);
}

TEST(Gltf, UnknownWordsAreTold) {
  GltfParts parts = encode_gltf(random_cloud(30, 0));
  Json& extension = primitive_of(parts.json)["extensions"]["KHR_gaussian_splatting"];
  extension = {{"kernel", "cube"}, {"colorSpace", "p3"}, {"projection", "fisheye"}};
  parts.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] = Json::object();
  EXPECT_THAT(
      parse_gltf(parts.glb()).notes,
      ::testing::UnorderedElementsAre(HasSubstr("kernel 'cube'"), HasSubstr("'fisheye'"),
                                      HasSubstr("colorSpace 'p3'"), HasSubstr("instances")));
}

}  // namespace
}  // namespace catgs::test
