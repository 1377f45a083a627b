#include "render_core/scene/scene_origin.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <random>

#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>

#include "render_core/scene/activations.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/save_scene.h"
#include "render_core/scene/files/scene_parts.h"
#include "render_core/scene/files/view_sample.h"
#include "render_core/scene/formats/compressed_ply.h"
#include "render_core/scene/formats/ksplat.h"
#include "render_core/scene/tree/build_tree.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_encoder.h"
#include "tests/render_core/scene/formats/ksplat_encoder.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using Json = nlohmann::json;

// A survey's coordinates, where floats lie up to 0.5 apart.
constexpr glm::dvec3 survey(500123.4, 5412345.3, 431.2);

/// Splats of 0.07 units, up to 12 units around 0.
GaussianCloud small_splats(std::size_t count = 200) {
  GaussianCloud cloud = random_cloud(count, 0);
  for (glm::vec3& mean : cloud.mean) mean = glm::clamp(mean, -12.0f, 12.0f);
  cloud.scale.assign(count, glm::vec3(0.07f));
  return cloud;
}

using Positions = std::vector<glm::dvec3>;

Positions moved(const GaussianCloud& cloud, const glm::dvec3& by) {
  Positions positions;
  for (const glm::vec3& mean : cloud.mean) positions.push_back(glm::dvec3(mean) + by);
  return positions;
}

void expect_near(const Positions& read, const Positions& told, double tolerance = 1e-4) {
  ASSERT_EQ(read.size(), told.size());
  double worst = 0.0;
  for (std::size_t i = 0; i < read.size(); ++i)
    worst = std::max(worst, glm::distance(read[i], told[i]));
  EXPECT_LT(worst, tolerance);
}

/// A .ply whose places are doubles.
std::string double_ply(const GaussianCloud& cloud, const Positions& positions,
                       const std::string& encoding) {
  std::string out =
      "ply\nformat " + encoding + " 1.0\nelement vertex " + std::to_string(positions.size()) + "\n";
  for (const char* name : {"x", "y", "z"}) out += std::string("property double ") + name + "\n";
  for (const char* name : {"f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
                           "rot_0", "rot_1", "rot_2", "rot_3"})
    out += std::string("property float ") + name + "\n";
  out += "end_header\n";
  const auto put = [&](auto value) {
    std::string bytes;
    append(bytes, value);
    if (encoding == "binary_big_endian") std::ranges::reverse(bytes);
    out += encoding == "ascii" ? fmt::format("{} ", value) : bytes;
  };
  for (std::size_t i = 0; i < positions.size(); ++i) {
    for (int k = 0; k < 3; ++k) put(positions[i][k]);
    for (int k = 0; k < 3; ++k) put(cloud.sh_of(i)[0][k]);
    put(logit(cloud.opacity[i]));
    for (int k = 0; k < 3; ++k) put(std::log(cloud.scale[i][k]));
    const glm::quat& q = cloud.rotation[i];
    for (const float v : {q.w, q.x, q.y, q.z}) put(v);
    if (encoding == "ascii") out += "\n";
  }
  return out;
}

/// SOG whose texels stand for places 8 units around the survey's, and these places.
std::map<std::string, std::string> far_sog(const GaussianCloud& cloud, Positions& told) {
  std::map<std::string, std::string> files = encode_sog(cloud, 2);
  Json meta = Json::parse(files.at("meta.json"));
  Json& means = meta["means"];
  told.assign(cloud.size(), {});
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    const double low = means["mins"][axis], high = means["maxs"][axis];
    const double far_low = std::log(survey[k] - 7.0), far_high = std::log(survey[k] + 9.0);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const double v = cloud.mean[i][k];
      const double log_mean = std::copysign(std::log(std::abs(v) + 1.0), v);
      const double steps =
          static_cast<double>(std::lround(257.0 * (255.0 * (log_mean - low) / (high - low))));
      told[i][k] = std::exp(far_low + (far_high - far_low) * steps / 65535.0) - 1.0;
    }
    means["mins"][axis] = far_low;
    means["maxs"][axis] = far_high;
  }
  files["meta.json"] = meta.dump();
  return files;
}

/// Compressed .ply: the limits of its one chunk are moved. They are floats, what lies between is
/// not.
std::string far_compressed_ply(const GaussianCloud& cloud, Positions& told) {
  std::string bytes = encode_compressed_ply(cloud, false);
  const MemorySource file("near.ply", bytes_of(bytes));
  const GaussianCloud near = read_compressed_ply(file, read_ply_header(file), two_threads());
  const std::size_t chunk = bytes.find("end_header\n") + 11;
  const auto limit = [&](std::size_t k) {
    return load_as<float>(bytes_of(bytes).data() + chunk + 4 * k);
  };
  told.assign(near.size(), {});
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    const float low = limit(axis), high = limit(3 + axis);
    const auto far_low = static_cast<float>(low + survey[k]),
               far_high = static_cast<float>(high + survey[k]);
    const double steps = k == 1 ? 1023.0 : 2047.0;
    for (std::size_t i = 0; i < near.size(); ++i) {
      const double share = std::round(steps * (near.mean[i][k] - low) / (high - low)) / steps;
      told[i][k] = far_low + (static_cast<double>(far_high) - far_low) * share;
    }
    std::memcpy(bytes.data() + chunk + 4 * axis, &far_low, sizeof far_low);
    std::memcpy(bytes.data() + chunk + 4 * (3 + axis), &far_high, sizeof far_high);
  }
  return bytes;
}

/// .ksplat: the centres of its buckets are moved. They are floats, the steps around them are finer.
std::string far_ksplat(const GaussianCloud& cloud, Positions& told) {
  std::string bytes = encode_ksplat(cloud, {.level = 1, .sections = 1});
  const GaussianCloud near = read_ksplat(MemorySource("near", bytes_of(bytes)), two_threads());
  told = moved(near, {});
  const std::size_t section = 4096, centres = section + 1024 + 2 * 4;
  const auto word = [&](std::size_t k) {
    return load_as<std::uint32_t>(bytes_of(bytes).data() + section + 4 * k);
  };
  const std::size_t bucket_rows = word(2), buckets = word(3), full = word(8);
  const std::size_t partial = load_as<std::uint32_t>(bytes_of(bytes).data() + section + 1024);
  for (std::size_t b = 0; b < buckets; ++b)
    for (int k = 0; k < 3; ++k) {
      const std::size_t at = centres + 12 * b + 4 * static_cast<std::size_t>(k);
      const auto centre = load_as<float>(bytes_of(bytes).data() + at);
      const auto far_centre = static_cast<float>(centre + survey[k]);
      std::memcpy(bytes.data() + at, &far_centre, sizeof far_centre);
      const std::size_t begin = b <= full ? b * bucket_rows : full * bucket_rows + partial;
      const std::size_t end = b < full    ? begin + bucket_rows
                              : b == full ? begin + partial
                                          : near.size();
      for (std::size_t i = begin; i < end; ++i)
        told[i][k] += static_cast<double>(far_centre) - static_cast<double>(centre);
    }
  return bytes;
}

/// glTF at the end of a chain of nodes: turned by an odd angle, then moved.
std::string far_gltf(const GaussianCloud& cloud, Positions& told) {
  GltfParts parts = encode_gltf(cloud);
  const glm::dquat turn = glm::angleAxis(0.7, glm::normalize(glm::dvec3(1.0, 2.0, -0.5)));
  const glm::dvec3 arm(4321.5, -1234.25, 98765.125), base(-survey.x, -survey.y, survey.z);
  parts.json["nodes"] = {{{"rotation", {turn.x, turn.y, turn.z, turn.w}},
                          {"translation", {base.x, base.y, base.z}},
                          {"children", {1}}},
                         {{"translation", {arm.x, arm.y, arm.z}}, {"mesh", 0}}};
  told.clear();
  for (const glm::vec3& mean : cloud.mean) {
    const glm::dvec3 stored(-mean.x, -mean.y, mean.z);
    const glm::dvec3 at = turn * (stored + arm) + base;
    told.push_back({-at.x, -at.y, at.z});
  }
  return parts.glb();
}

class SceneOriginTest : public FolderTest {
 protected:
  void expect_told(const Scene& scene, const Positions& told) const {
    EXPECT_NE(scene.hints.origin, glm::dvec3(0.0));
    EXPECT_EQ(scene.hints.origin, glm::round(scene.hints.origin)) << "whole units";
    expect_near(moved(scene.cloud, scene.hints.origin), told);
    const auto names_origin = ::testing::HasSubstr(fmt::format("[{}, ", scene.hints.origin.x));
    EXPECT_THAT(scene.notes, ::testing::Contains(names_origin));
  }
};

TEST_F(SceneOriginTest, FarPlacesAreAsTheFileSays) {
  const GaussianCloud cloud = small_splats();
  const Positions positions = moved(cloud, survey);
  Positions told;
  struct Case {
    std::string name;
    std::string bytes;
    Positions told;
  };
  std::vector<Case> cases;
  for (const char* encoding : {"binary_little_endian", "binary_big_endian", "ascii"})
    cases.push_back(
        {std::string(encoding) + ".ply", double_ply(cloud, positions, encoding), positions});
  cases.push_back({"a.sog", zip(far_sog(cloud, told)), {}});
  cases.back().told = told;
  cases.push_back({"b.compressed.ply", far_compressed_ply(cloud, told), {}});
  cases.back().told = told;
  cases.push_back({"c.ksplat", far_ksplat(cloud, told), {}});
  cases.back().told = told;
  cases.push_back({"d.glb", far_gltf(cloud, told), {}});
  cases.back().told = told;
  for (const Case& of : cases) {
    SCOPED_TRACE(of.name);
    expect_told(load_scene(write(of.name, of.bytes)), of.told);
  }
}

TEST_F(SceneOriginTest, FarFloatsStayAsTheyAre) {
  GaussianCloud cloud = small_splats();
  for (glm::vec3& mean : cloud.mean) mean = glm::vec3(glm::dvec3(mean) + survey);
  for (const char* name : {"a.ply", "b.splat"}) {
    SCOPED_TRACE(name);
    save_scene(cloud, folder_ / name);
    const Scene scene = load_scene(folder_ / name);
    expect_told(scene, moved(cloud, {}));
    EXPECT_EQ(moved(scene.cloud, scene.hints.origin), moved(cloud, {})) << "to the last bit";
  }
}

TEST_F(SceneOriginTest, PartsTooFarApartAreTold) {
  const GaussianCloud cloud = small_splats();
  Positions positions = moved(cloud, {});
  for (int i = 0; i < 80; ++i) positions[i] += survey;
  const Scene scene = load_scene(write("apart.ply", double_ply(cloud, positions, "ascii")));
  EXPECT_THAT(scene.notes, testing::Contains(testing::StartsWith("80 of 200 Gaussians are")));
}

TEST_F(SceneOriginTest, PartsShareOneOrigin) {
  const GaussianCloud cloud = small_splats(1000);
  const Positions positions = moved(cloud, survey);
  Positions fine, coarse;
  for (const auto& [file, bytes] : far_sog(cloud, fine)) write("sog/0/" + file, bytes);
  for (const auto& [file, bytes] : far_sog(small_splats(100), coarse))
    write("sog/1/" + file, bytes);
  const auto piece = [](int file, int count) -> Json {
    return {{"file", file}, {"offset", 0}, {"count", count}};
  };
  const Json lods = {{"0", piece(0, 1000)}, {"1", piece(1, 100)}};
  write("sog/lod-meta.json", Json{{"lodLevels", 2},
                                  {"filenames", {"0/meta.json", "1/meta.json"}},
                                  {"tree", {{"lods", lods}}}}
                                 .dump());
  const auto pool = std::make_shared<ThreadPool>(2);
  const std::vector<std::pair<std::filesystem::path, Positions>> cases = {
      {write("a.ply", double_ply(cloud, positions, "binary_little_endian")), positions},
      {write("b.ply", double_ply(cloud, positions, "binary_big_endian")), positions},
      {folder_ / "sog", fine}};
  for (const auto& [path, told] : cases) {
    SCOPED_TRACE(path.string());
    const auto scene = scene_in_parts(locate_scene(path), {}, pool, 77);
    ASSERT_TRUE(scene);
    Positions read;
    scene->parts.each([&](const GaussianCloud& part) {
      std::ranges::copy(moved(part, scene->parts.origin), std::back_inserter(read));
    });
    expect_near(read, told);
    EXPECT_EQ(scene->hints.origin, scene->parts.origin);
    // As in memory, so that visitors can change from one to the other.
    if (path.extension() == ".ply")
      EXPECT_EQ(load_scene(path).hints.origin, scene->parts.origin);
    else
      expect_told(load_scene(path), told);
  }
}

TEST_F(SceneOriginTest, ATreeKeepsItsOrigin) {
  const GaussianCloud cloud = small_splats(3000);
  const auto pool = std::make_shared<ThreadPool>(2);
  const glm::dvec3 whole = glm::round(survey);
  const auto built = [&](const std::string& name, const glm::dvec3& by) {
    const auto path =
        write(name + ".ply", double_ply(cloud, moved(cloud, by), "binary_little_endian"));
    const auto scene = scene_in_parts(locate_scene(path), {}, pool, 777);
    build_tree(scene->parts, folder_ / (name + ".tree"), 1'000'000, *pool, LoadContext(*pool));
    return folder_ / (name + ".tree");
  };
  const auto far = built("far", whole), near = built("near", {});
  const Scene read = load_scene(far), twin = load_scene(near);
  const glm::dvec3 origin = read.hints.origin;
  EXPECT_LT(glm::distance(origin, whole), 30.0);
  EXPECT_EQ(twin.hints.origin, glm::dvec3(0.0));
  EXPECT_EQ(open_in_pages(locate_scene(far)).outline.hints.origin, origin);
  // Means have 16 bits of a cluster's extent in either.
  expect_near(moved(read.cloud, origin - whole), moved(twin.cloud, {}), 1e-3);

  std::string bytes = content_of(far);
  ++bytes[568];  // of the origin
  EXPECT_EQ(refusal_of([&] { load_scene(write("damaged.tree", bytes)); }).where, "origin");
}

TEST_F(SceneOriginTest, LevelsShareTheOriginOfTheirTiles) {
  // Nearer than 10,000 units the frame of a tileset stays as it is.
  GaussianCloud cloud = small_splats();
  const glm::dvec3 at(2345.6, -7654.3, 12.1);
  write("a.glb", encode_gltf(cloud).glb());
  Json root = {{"geometricError", 1}, {"refine", "REPLACE"}, {"content", {{"uri", "a.glb"}}}};
  root["transform"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, at.x, at.y, at.z, 1};
  write("tileset.json",
        Json{{"asset", {{"version", "1.1"}}}, {"geometricError", 9}, {"root", root}}.dump());
  Positions told;
  for (const glm::vec3& mean : cloud.mean) {
    const glm::dvec3 gltf(-mean.x, -mean.y, mean.z);  // y up
    const glm::dvec3 z_up = glm::dvec3(gltf.x, -gltf.z, gltf.y) + at;
    told.push_back({z_up.x, -z_up.z, z_up.y});
  }
  expect_told(load_scene(folder_.path()), told);
}

TEST_F(SceneOriginTest, HintFilesCountFromTheFilesZero) {
  const GaussianCloud cloud = small_splats();
  write("a.ply", double_ply(cloud, moved(cloud, survey), "binary_little_endian"));
  const auto point = [](const glm::dvec3& by) -> Json {
    return {survey.x + by.x, survey.y + by.y, survey.z + by.z};
  };
  const auto at = [](const SceneHints& hints, const glm::vec3& p) {
    return glm::dvec3(p) + hints.origin - survey;
  };
  write("a.json", Json{{"start_pose", {{"position", point({1, 2, -20})}, {"look_at", point({})}}},
                       {"limits", {{"min", point({-30, -30, -30})}, {"max", point({30, 30, 30})}}},
                       {"focus", point({0.25, 0, 0})}}
                      .dump());
  const Scene scene = load_scene(folder_ / "a.ply");
  const SceneHints& hints = scene.hints;
  EXPECT_LT(glm::distance(at(hints, hints.start_pose.position), {1, 2, -20}), 1e-4);
  EXPECT_LT(glm::distance(at(hints, hints.limits.max), {30, 30, 30}), 1e-4);
  EXPECT_LT(glm::distance(at(hints, hints.focus), {0.25, 0, 0}), 1e-4);
  write_sidecar(hints, folder_ / "again.json");
  const Json again = Json::parse(content_of(folder_ / "again.json"));
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(again["limits"]["min"][k].get<double>(), point({-30, -30, -30})[k].get<double>(),
                1e-4);

  // The cameras of a training: a 3x3 rotation, or a 4x4 matrix.
  const glm::dvec3 eye(3.1, 0.2, -15.7);
  const glm::dvec3 there = survey + eye;
  const Json rows = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  write("cameras.json", Json::array({{{"position", point(eye)}, {"rotation", rows}}}).dump());
  write(
      "transforms.json",
      Json{
          {"frames",
           Json::array(
               {{{"transform_matrix",
                  {{1, 0, 0, there.x}, {0, -1, 0, there.y}, {0, 0, -1, there.z}, {0, 0, 0, 1}}}}})}}
          .dump());
  for (const char* file : {"cameras.json", "transforms.json"}) {
    HintFiles files;
    files.cameras = folder_ / file;
    files.origin = scene.hints.origin;
    std::vector<std::string> notes;
    const SceneHints found = find_hints([&] { return view_sample(scene.cloud); }, files, {}, notes,
                                        std::make_shared<ThreadPool>(1));
    EXPECT_LT(glm::distance(at(found, found.start_pose.position), eye), 1e-4) << file;
  }
}

TEST(SceneOrigin, TheBulkOfAScenePutsIt) {
  const auto cluster = [](std::vector<glm::vec3>& positions, std::size_t count,
                          const glm::vec3& at) {
    for (const glm::vec3& mean : small_splats(count).mean) positions.push_back(at + mean);
  };
  struct Case {
    std::string name;
    std::vector<std::pair<std::size_t, glm::vec3>> clusters;
    glm::dvec3 origin;
  };
  const glm::vec3 there(survey);
  const std::vector<Case> cases = {
      {"near", {{100, {1000, -900, 3}}}, {0, 0, 0}},
      {"a single outlier", {{100, {0, 0, 0}}, {1, {1e8f, 1e8f, 1e8f}}}, {0, 0, 0}},
      {"a single near one", {{100, there}, {1, {0, 0, 0}}}, survey},
      {"a far node and a smaller near one", {{100, there}, {60, {0, 0, 0}}}, survey},
      {"a near node and a smaller far one", {{100, {0, 0, 0}}, {60, there}}, {0, 0, 0}},
      {"far ones on both sides", {{51, {9e5f, -7e6f, 0}}, {50, {-9e5f, 7e6f, 0}}}, {9e5, -7e6, 0}},
      {"nothing usable", {{3, glm::vec3(NAN)}, {3, glm::vec3(1e12f)}}, {0, 0, 0}},
      {"nothing", {}, {0, 0, 0}}};
  for (const Case& of : cases) {
    std::vector<glm::vec3> positions;
    for (const auto& [count, at] : of.clusters) cluster(positions, count, at);
    const glm::dvec3 origin = find_origin(positions);
    if (of.origin == glm::dvec3(0.0))
      EXPECT_EQ(origin, glm::dvec3(0.0)) << of.name;
    else
      EXPECT_LT(glm::distance(origin, of.origin), 20.0) << of.name;
  }
}

TEST_F(SceneOriginTest, PlacesFarFromTheOriginKeepAFloatsDigits) {
  // A far node beside a near one, and a scene of 6,000 units: half of them are further than floats
  // hold to 1e-4, and err by half a step of theirs.
  GaussianCloud cloud = small_splats();
  struct Case {
    std::string name;
    std::function<glm::dvec3(std::size_t)> by;
  };
  for (const Case& of :
       {Case{"mixed.ply", [](std::size_t i) { return i % 3 == 0 ? glm::dvec3(0.0) : survey; }},
        Case{"wide.ply", [](std::size_t i) {
               return survey + glm::dvec3(30.0 * static_cast<double>(i), 0.0, 0.0);
             }}}) {
    SCOPED_TRACE(of.name);
    Positions told;
    for (std::size_t i = 0; i < cloud.size(); ++i)
      told.push_back(glm::dvec3(cloud.mean[i]) + of.by(i));
    const Scene scene = load_scene(write(of.name, double_ply(cloud, told, "binary_little_endian")));
    const Positions read = moved(scene.cloud, scene.hints.origin);
    ASSERT_EQ(read.size(), told.size());
    std::size_t close = 0;
    for (std::size_t i = 0; i < told.size(); ++i) {
      const glm::dvec3 from_origin = glm::abs(told[i] - scene.hints.origin);
      const double largest = std::max({from_origin.x, from_origin.y, from_origin.z});
      close += largest < 1024.0;
      EXPECT_LE(glm::distance(read[i], told[i]), std::max(1e-4, largest * 1.1e-7)) << i;
    }
    EXPECT_GT(close, of.name == "mixed.ply" ? 100u : 60u);
  }
}

TEST_F(SceneOriginTest, WrittenCopiesHaveTheSameCoordinates) {
  const GaussianCloud cloud = small_splats();
  const Positions positions = moved(cloud, survey);
  const Scene scene =
      load_scene(write("a.ply", double_ply(cloud, positions, "binary_little_endian")));
  for (const char* name : {"b.ply", "b.glb"}) {
    ASSERT_TRUE(keeps_origin(name));
    save_scene(scene.cloud, folder_ / name, 2, scene.hints.origin);
    SCOPED_TRACE(name);
    expect_told(load_scene(folder_ / name), positions);
  }
  for (const char* name : {"b.sog", "b.spz", "b.splat"}) {
    EXPECT_FALSE(keeps_origin(name)) << name;
    save_scene(scene.cloud, folder_ / name, 2, scene.hints.origin);
    EXPECT_EQ(load_scene(folder_ / name).hints.origin, glm::dvec3(0.0)) << "about its origin";
  }
}

}  // namespace
}  // namespace catgs::test
