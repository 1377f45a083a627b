#include "render_core/scene/formats/lcc.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/files/scene_size.h"
#include "render_core/scene/transform.h"
#include "tests/render_core/scene/formats/json_refusals.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using Json = nlohmann::json;

constexpr float most_scale = 4.0f, most_sh = 3.0f;

std::uint32_t steps_of(float value, float least, float most, std::uint32_t steps) {
  const float share = std::clamp((value - least) / (most - least), 0.0f, 1.0f);
  return static_cast<std::uint32_t>(std::lround(share * static_cast<float>(steps)));
}

/// A Gaussian as data.bin has it, from the description of the format.
std::string row_of(const GaussianCloud& cloud, std::size_t i) {
  std::string row;
  append(row, cloud.mean[i]);
  for (int k = 0; k < 3; ++k)
    row += static_cast<char>(steps_of(0.5f + 0.2820948f * cloud.sh_of(i)[0][k], 0, 1, 255));
  row += static_cast<char>(steps_of(cloud.opacity[i], 0, 1, 255));
  for (int k = 0; k < 3; ++k)
    append(row, static_cast<std::uint16_t>(steps_of(cloud.scale[i][k], 0, most_scale, 65535)));
  const glm::quat& q = cloud.rotation[i];
  const std::array<float, 4> xyzw = {q.x, q.y, q.z, q.w};
  const auto less = [](float a, float b) { return std::abs(a) < std::abs(b); };
  const auto largest =
      static_cast<std::size_t>(std::max_element(xyzw.begin(), xyzw.end(), less) - xyzw.begin());
  auto packed = static_cast<std::uint32_t>(largest) << 30;
  for (std::size_t k = 0, shift = 0; k < 4; ++k) {
    if (k == largest) continue;
    const float value = xyzw[largest] < 0.0f ? -xyzw[k] : xyzw[k];
    packed |= steps_of(value, -std::sqrt(0.5f), std::sqrt(0.5f), 1023) << shift;
    shift += 10;
  }
  append(row, packed);
  return row.append(6, '\x55');  // a normal
}

std::string sh_row_of(const GaussianCloud& cloud, std::size_t i) {
  std::string row;
  for (int k = 1; k < 16; ++k) {
    const glm::vec3& sh = cloud.sh_of(i)[k];
    append(row, steps_of(sh.x, -most_sh, most_sh, 2047) |
                    steps_of(sh.y, -most_sh, most_sh, 1023) << 11 |
                    steps_of(sh.z, -most_sh, most_sh, 2047) << 21);
  }
  return row.append(4, '\x55');
}

class LccTest : public FolderTest {
 protected:
  /// Each cell has these Gaussians on its levels, the finest one first.
  void write_scene(const std::vector<std::vector<std::size_t>>& cells, bool has_sh = true) {
    std::size_t first = 0;
    std::string index, data, sh;
    for (const std::vector<std::size_t>& levels : cells) {
      append(index, std::int32_t{0});
      for (const std::size_t count : levels) {
        append(index, static_cast<std::int32_t>(count));
        append(index, static_cast<std::int64_t>(data.size()));
        append(index, static_cast<std::int32_t>(32 * count));
        for (std::size_t i = 0; i < count; ++i, ++first) {
          data += row_of(cloud_, first);
          sh += sh_row_of(cloud_, first);
        }
      }
    }
    write("index.bin", index);
    write("data.bin", data);
    write("shcoef.bin", sh);
    const auto range = [](const char* name, float min, float max) {
      return Json{{"name", name}, {"min", {min, min, min}}, {"max", {max, max, max}}};
    };
    meta_ = {{"version", "5.0"},
             {"totalLevel", cells.front().size()},
             {"encoding", "COMPRESS"},
             {"fileType", has_sh ? "Quality" : "Portable"},
             {"attributes", {range("scale", 0, most_scale), range("shcoef", -most_sh, most_sh)}}};
    write("meta.lcc", meta_.dump());
  }
  OpenLevels open(std::optional<int> level = {}, std::optional<std::size_t> budget = {}) const {
    return open_lcc(std::make_shared<FolderFiles>(folder_.path()), "meta.lcc", level, budget);
  }
  Refusal refusal() const {
    return refusal_of([this] { open(); });
  }
  /// Gaussians [begin, end) of those that are written, as they should be read.
  GaussianCloud wanted(std::size_t begin, std::size_t end, int degree) const {
    GaussianCloud cloud;
    cloud.resize(end - begin, degree);
    const CloudTransform transform({glm::dmat3(1, 0, 0, 0, 0, 1, 0, -1, 0), {}});
    for (std::size_t i = begin; i < end; ++i) {
      cloud.mean[i - begin] = cloud_.mean[i];
      cloud.rotation[i - begin] = cloud_.rotation[i];
      cloud.scale[i - begin] = cloud_.scale[i];
      cloud.opacity[i - begin] = cloud_.opacity[i];
      std::copy_n(cloud_.sh_of(i), cloud.sh_count(),
                  &cloud.sh[(i - begin) * static_cast<std::size_t>(cloud.sh_count())]);
      transform.apply(cloud, i - begin);
    }
    return cloud;
  }

  static GaussianCloud storable() {
    GaussianCloud cloud = random_cloud(2000, 3);
    for (glm::vec3& sh : cloud.sh) sh = glm::clamp(sh, -1.7f, 1.7f);
    for (glm::vec3& scale : cloud.scale) scale = glm::clamp(scale, 0.05f, most_scale);
    return cloud;
  }

  const GaussianCloud cloud_ = storable();
  Json meta_;
  static constexpr Tolerance steps_ = {.mean = 1e-5f,
                                       .log_scale = 0.51f * most_scale / 65535 / 0.05f,
                                       .rotation_rad = 0.01f,
                                       .opacity = 0.51f / 255,
                                       .sh0 = 0.51f / 255 / 0.2820948f,
                                       .sh1 = 0.02f,
                                       .sh_rest = 0.02f};
};

TEST_F(LccTest, TheFinestLevelIsRead) {
  write_scene({{1000}});
  expect_near(wanted(0, 1000, 3), read_levels(open(), two_threads()), steps_);
  write_scene({{1000}}, false);
  std::filesystem::remove(folder_ / "shcoef.bin");
  expect_near(wanted(0, 1000, 0), read_levels(open(), two_threads()), steps_);
}

TEST_F(LccTest, LevelsStandForEachOther) {
  write_scene({{100, 30, 7}, {200, 0, 9}, {0, 0, 5}});
  EXPECT_EQ(open().levels, 3);
  EXPECT_EQ(open().count, 305u);
  EXPECT_EQ(open(2).count, 21u);
  EXPECT_LE(open({}, 150).count, 150u);
  const GaussianCloud coarse = read_levels(open(2), two_threads());
  ASSERT_EQ(coarse.size(), 21u);
  EXPECT_LT(glm::distance(coarse.mean[0], wanted(130, 131, 0).mean[0]), 1e-5f);
}

TEST_F(LccTest, TheEnvironmentIsOnEachLevel) {
  write_scene({{100, 10}});
  std::string environment;
  for (std::size_t i = 500; i < 520; ++i) environment += row_of(cloud_, i) + sh_row_of(cloud_, i);
  write("environment.bin", environment);
  EXPECT_EQ(open().count, 120u);
  EXPECT_EQ(open(1).count, 30u);
  const GaussianCloud read = read_levels(open(), two_threads());
  EXPECT_LT(glm::distance(read.mean[100], wanted(500, 501, 0).mean[0]), 1e-5f);
  write("environment.bin", environment + "x");
  EXPECT_EQ(refusal().source, (folder_ / "environment.bin").string());
}

TEST_F(LccTest, ScenesAreKnownByTheirName) {
  write_scene({{100, 10}});
  const Scene scene = load_scene(folder_ / "meta.lcc");
  EXPECT_EQ(scene.format, "LCC (level 0 of 0…1)");
  EXPECT_EQ(scene.name, folder_.path().filename().string());
  EXPECT_EQ(read_scene_size(locate_scene(folder_.path())).gaussians, 100u);
  EXPECT_EQ(files_beside(folder_ / "meta.lcc").size(), 3u);
}

TEST_F(LccTest, MistakesAreRefused) {
  write_scene({{100, 10}});
  const auto read = [this](const Json& json) {
    write("meta.lcc", json.dump());
    open();
  };
  expect_refused(meta_, (folder_ / "meta.lcc").string(), read,
                 {{"/totalLevel", 0, "totalLevel"},
                  {"/totalLevel", 17, "totalLevel"},
                  {"/encoding", "RAW", "encoding"},
                  {"/attributes/0/min", {1, 2}, "attributes[0].min"},
                  {"/attributes/0/name", "size", "attributes"}});
  const auto with_run = [&](std::int32_t count, std::int64_t offset) {
    std::string index(4, '\0');
    append(index, count);
    append(index, offset);
    append(index, std::int32_t{0});
    write("index.bin", index);
    return refusal();
  };
  meta_["totalLevel"] = 1;
  write("meta.lcc", meta_.dump());
  for (const auto& [count, offset] : std::vector<std::pair<std::int32_t, std::int64_t>>{
           {-1, 0}, {111, 0}, {1, 32 * 110}, {1, -32}, {1 << 30, 0}})
    EXPECT_EQ(with_run(count, offset), (Refusal{(folder_ / "index.bin").string(), "byte 4"}));
  write("index.bin", std::string(19, '\0'));
  EXPECT_EQ(refusal(), (Refusal{(folder_ / "index.bin").string(), "byte 19"}));
  write("index.bin", std::string(20, '\0'));
  EXPECT_EQ(refusal(), (Refusal{(folder_ / "meta.lcc").string(), ""})) << "no Gaussians";
  std::string shared;
  for (int cell = 0; cell < 3; ++cell) {
    append(shared, std::int32_t{0});
    append(shared, std::int32_t{100});
    append(shared, std::int64_t{0});
    append(shared, std::int32_t{3200});
  }
  write("index.bin", shared);
  EXPECT_EQ(refusal(), (Refusal{(folder_ / "meta.lcc").string(), ""}));
  std::filesystem::remove(folder_ / "data.bin");
  EXPECT_EQ(refusal().source, (folder_ / "data.bin").string());
}

}  // namespace
}  // namespace catgs::test
