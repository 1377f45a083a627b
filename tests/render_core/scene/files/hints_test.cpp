#include "render_core/scene/files/hints.h"

#include <cmath>

#include <fmt/format.h>

#include "render_core/scene/analysis/first_sight.h"
#include "render_core/scene/analysis/robust_bounds.h"
#include "render_core/scene/analysis/voxel_grid.h"
#include "render_core/scene/formats/json_field.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/streamed_sog.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr glm::vec3 down_y(0, -1, 0);

void expect_near(const glm::vec3& a, const glm::vec3& b, float tolerance = 1e-5f) {
  EXPECT_LT(glm::distance(a, b), tolerance)
      << a.x << " " << a.y << " " << a.z << " against " << b.x << " " << b.y << " " << b.z;
}

glm::vec3 forward(const Pose& pose) { return pose.orientation * glm::vec3(0, 0, 1); }
glm::vec3 up(const Pose& pose) { return pose.orientation * glm::vec3(0, -1, 0); }

/// Opaque discs of `size` on a surface that `place` samples.
GaussianCloud surface(std::size_t count, float size, const std::function<glm::vec3()>& place) {
  GaussianCloud cloud;
  cloud.resize(count, 0);
  for (std::size_t i = 0; i < count; ++i) {
    cloud.mean[i] = place();
    cloud.scale[i] = glm::vec3(size);
    cloud.rotation[i] = glm::quat(1, 0, 0, 0);
    cloud.opacity[i] = 0.9f;
  }
  return cloud;
}

/// Filled: a hollow one is a room.
GaussianCloud ball(float radius) {
  auto random = std::make_shared<std::mt19937>(1);
  return surface(20000, 0.02f * radius, [=] {
    std::normal_distribution<float> normal;
    std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
    const glm::vec3 direction(normal(*random), normal(*random), normal(*random));
    return radius * std::cbrt(uniform(*random)) * glm::normalize(direction);
  });
}

/// The walls, floor and ceiling of a room 8 x 3 x 6.
GaussianCloud room() {
  auto random = std::make_shared<std::mt19937>(2);
  return surface(60000, 0.05f, [=] {
    std::uniform_real_distribution<float> uniform(-1.0f, 1.0f);
    glm::vec3 p(uniform(*random), uniform(*random), uniform(*random));
    const int face = std::uniform_int_distribution<int>(0, 2)(*random);
    p[face] = p[face] < 0 ? -1.0f : 1.0f;
    return p * glm::vec3(4.0f, 1.5f, 3.0f);
  });
}

TEST(FirstSight, LookAtKeepsUpUprightInTheImage) {
  const glm::vec3 eye(3, -2, 5), target(0, 0, 1);
  const Pose pose = look_at(eye, target, down_y);
  expect_near(forward(pose), glm::normalize(target - eye));
  const glm::vec3 u = camera_from_world_rotation(pose) * down_y;
  EXPECT_NEAR(u.x, 0.0f, 1e-5f);
  EXPECT_LT(u.y, 0.0f);  // image y points down
}

TEST(FirstSight, LookAtAcceptsDegenerateDirections) {
  for (const glm::vec3& target : {glm::vec3(0, -5, 0), glm::vec3(0, 5, 0), glm::vec3(0)}) {
    const Pose pose = look_at(glm::vec3(0), target, down_y);
    EXPECT_NEAR(glm::length(pose.orientation), 1.0f, 1e-5f);
    if (target != glm::vec3(0)) expect_near(forward(pose), glm::normalize(target));
  }
}

TEST(FirstSight, RobustBoundsIgnoreWhatEscapedAndWhatIsTransparent) {
  GaussianCloud cloud = room();
  for (std::size_t i = 0; i < 1000; ++i) cloud.mean[i] = glm::vec3(500.0f, 0.0f, 0.0f);
  for (std::size_t i = 1000; i < 20000; ++i) {
    cloud.mean[i].y = -40.0f;
    cloud.opacity[i] = 0.01f;
  }
  const Bounds bounds = *robust_bounds(cloud);
  EXPECT_NEAR(bounds.min.x, -4.0f, 0.1f);
  EXPECT_NEAR(bounds.max.x, 4.0f, 0.1f);
  EXPECT_NEAR(bounds.min.y, -1.5f, 0.1f);
  EXPECT_FALSE(robust_bounds(GaussianCloud{}).has_value());
}

TEST(FirstSight, ObjectsAreSeenFromOutside) {
  for (const float radius : {0.01f, 1.0f, 300.0f}) {
    const GaussianCloud cloud = ball(radius);
    const SceneHints hints = estimate_hints(cloud);
    const float distance = glm::length(hints.start_pose.position);
    EXPECT_GT(distance, 1.3f * radius);
    EXPECT_LT(distance, 5.0f * radius);
    EXPECT_GT(glm::dot(forward(hints.start_pose), -hints.start_pose.position), 0.95f * distance);
    EXPECT_LT(hints.start_pose.position.z, 0.0f) << "not from the usual front";
    EXPECT_LT(hints.near_z, 0.1f * radius);
    std::size_t inside = 0;  // of an image of 16:9, 53 degrees high
    for (const glm::vec3& mean : cloud.mean) {
      const glm::vec3 p =
          camera_from_world_rotation(hints.start_pose) * (mean - hints.start_pose.position);
      inside += std::abs(p.x) < 0.889f * p.z && std::abs(p.y) < 0.5f * p.z;
    }
    EXPECT_GT(inside, cloud.size() * 9 / 10) << "cut off by the border of the image";
    EXPECT_GE(up(hints.start_pose).y, -1.0f);
    EXPECT_LT(up(hints.start_pose).y, -0.5f);
    EXPECT_EQ(hints.source, "estimated");
  }
}

TEST(FirstSight, RoomsAreSeenFromInside) {
  const SceneHints hints = estimate_hints(room());
  const glm::vec3 eye = glm::abs(hints.start_pose.position);
  EXPECT_LT(eye.x, 4.0f);
  EXPECT_LT(eye.y, 1.5f);
  EXPECT_LT(eye.z, 3.0f);
}

TEST(FirstSight, TheCameraNeverStandsInsideOfACluster) {
  // A fog ball around the middle and a wall of it on every place but one side.
  GaussianCloud cloud = ball(1.0f);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(-3.0f, 3.0f);
  GaussianCloud fog = surface(60000, 0.1f, [&] {
    return glm::vec3(uniform(random), uniform(random), std::abs(uniform(random)));
  });
  for (std::size_t i = 0; i < fog.size(); ++i) {
    cloud.mean.push_back(fog.mean[i]);
    cloud.rotation.push_back(fog.rotation[i]);
    cloud.scale.push_back(fog.scale[i]);
    cloud.opacity.push_back(0.1f);
    cloud.sh.push_back(fog.sh[i]);
  }
  const SceneHints hints = estimate_hints(cloud);
  const VoxelGrid grid(cloud, hints.start_pose.position, 2.0f);
  EXPECT_LT(grid.depth_around(hints.start_pose.position), 0.2f);
}

TEST(FirstSight, AnyUpIsKept) {
  const GaussianCloud cloud = ball(1.0f);
  for (const glm::vec3& axis : {glm::vec3(0, 0, 1), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)})
    EXPECT_GT(glm::dot(up(estimate_hints(cloud, axis).start_pose), axis), 0.5f);
}

TEST(FirstSight, DegenerateCloudsGetAUsablePose) {
  GaussianCloud one = random_cloud(1, 0);
  for (const GaussianCloud& cloud : {one, GaussianCloud{}}) {
    const SceneHints hints = estimate_hints(cloud);
    EXPECT_TRUE(std::isfinite(glm::length(hints.start_pose.position)));
    EXPECT_NEAR(glm::length(hints.start_pose.orientation), 1.0f, 1e-5f);
    EXPECT_GT(hints.near_z, 0.0f);
    EXPECT_LT(hints.limits.min.x, hints.limits.max.x);
  }
}

Sidecar parse_sidecar(const std::string& text) {
  return read_sidecar(MemorySource("city.json", bytes_of(text)));
}

TEST(Sidecar, FieldsAreRead) {
  const Sidecar sidecar = parse_sidecar(R"({
    "up": "+z", "near": 0.05, "focus": [1, 2, 3], "limits": {"min": [0, 0, 0], "max": [1, 1, 1]},
    "start_pose": {"position": [4, 5, 6], "look_at": [0, 0, 0]}, "tours": [{"anything": true}]})");
  EXPECT_EQ(sidecar.up, glm::vec3(0, 0, 1));
  EXPECT_EQ(sidecar.near_z, 0.05f);
  EXPECT_EQ(sidecar.focus, glm::vec3(1, 2, 3));
  EXPECT_EQ(sidecar.limits->max, glm::vec3(1));
  EXPECT_EQ(sidecar.start_pose->position, glm::vec3(4, 5, 6));
  EXPECT_EQ(sidecar.start_pose->look_at, glm::vec3(0));
  EXPECT_EQ(parse_sidecar(R"({"up": [0, -2, 0]})").up, down_y);
  EXPECT_EQ(parse_sidecar(R"({"up": "-x"})").up, glm::vec3(-1, 0, 0));
  EXPECT_FALSE(parse_sidecar("{}").up);
}

TEST(Sidecar, ErrorsNameTheField) {
  const auto error = [](const char* text) { return input_error([&] { parse_sidecar(text); }); };
  EXPECT_THAT(error(R"({"up": )"), HasSubstr("city.json: byte"));
  EXPECT_THAT(error("[]"), HasSubstr("not a JSON object"));
  EXPECT_THAT(error(R"({"up": "w"})"), HasSubstr("city.json: up:"));
  EXPECT_THAT(error(R"({"up": [0, 0, 0]})"), HasSubstr("up: has no direction"));
  EXPECT_THAT(error(R"({"near": 0})"), HasSubstr("near: is not positive"));
  EXPECT_THAT(error(R"({"near": 1.1e9})"), HasSubstr("near: is beyond 1000000000 units"));
  EXPECT_THAT(error(R"({"focus": [0, -1.1e9, 0]})"),
              HasSubstr("focus: is no place in a scene: beyond 1000000000 units"));
  EXPECT_THAT(error(R"({"near": 1e99})"), HasSubstr("near: is out of range"));
  EXPECT_THAT(error(R"({"focus": [1, 2, "c"]})"), HasSubstr("focus[2]: is not a number"));
  EXPECT_THAT(error(R"({"limits": {"min": [0, 0, 0], "max": [1, 0, 1]}})"), HasSubstr("limits"));
  EXPECT_THAT(error(R"({"start_pose": {"position": [0, 0, 0]}})"),
              HasSubstr("start_pose: 'orientation' is missing"));
  EXPECT_THAT(error(R"({"start_pose": {"position": [0, 0, 0], "orientation": [1, 1, 1, 1]}})"),
              HasSubstr("start_pose.orientation"));
}

class Hints : public FolderTest {
 protected:
  SceneHints find() {
    return find_hints(cloud_,
                      {folder_ / "s.json", folder_ / "cameras.json", folder_ / "transforms.json"},
                      notes_);
  }
  GaussianCloud cloud_ = ball(1.0f);
  std::vector<std::string> notes_;
};

// Two level cameras that look along +x and -z with y down, one of them rolled a little.
constexpr const char* cameras_json = R"([
  {"id": 0, "img_name": "a", "width": 10, "height": 10, "fx": 5, "fy": 5,
   "position": [-3, 0, 0], "rotation": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]},
  {"id": 1, "position": [0, 0, 3], "rotation": [[-1, 0, 0], [0, 1, 0], [0, 0, -1]]}])";

TEST_F(Hints, TrainingCamerasGiveTheStartPoseUpAndLimits) {
  write("cameras.json", cameras_json);
  const SceneHints hints = find();
  EXPECT_EQ(hints.source, "cameras.json");
  expect_near(hints.up, down_y);
  expect_near(hints.start_pose.position, {-3, 0, 0});
  expect_near(forward(hints.start_pose), {1, 0, 0});
  expect_near(up(hints.start_pose), down_y);
  expect_near(hints.focus, {0, 0, 0}, 0.05f);
  const float margin = 0.5f * std::sqrt(18.0f);
  expect_near(hints.limits.min, glm::vec3(-3, 0, 0) - margin);
  expect_near(hints.limits.max, glm::vec3(0, 0, 3) + margin);
}

TEST_F(Hints, TransformsHaveOpenGlAxes) {
  write("transforms.json", R"({"camera_model": "OPENCV", "frames": [{"file_path": "a.png",
    "transform_matrix": [[1, 0, 0, 0.5], [0, 0, -1, -4], [0, 1, 0, 0.25], [0, 0, 0, 1]]}]})");
  const SceneHints hints = find();
  EXPECT_EQ(hints.source, "transforms.json");
  expect_near(hints.up, {0, 0, 1});
  expect_near(hints.start_pose.position, {0.5f, -4, 0.25f});
  expect_near(forward(hints.start_pose), {0, 1, 0});
}

TEST_F(Hints, TheSidecarGoesFirst) {
  write("cameras.json", cameras_json);
  write("s.json", R"({"up": "+z", "near": 0.5,
                      "start_pose": {"position": [9, 0, 1], "look_at": [0, 0, 0]}})");
  const SceneHints hints = find();
  EXPECT_EQ(hints.source, "sidecar s.json");
  expect_near(hints.up, {0, 0, 1});
  EXPECT_EQ(hints.near_z, 0.5f);
  expect_near(hints.start_pose.position, {9, 0, 1});
  EXPECT_GT(up(hints.start_pose).z, 0.9f);
  expect_near(hints.focus, {0, 0, 0});
}

TEST_F(Hints, AnUnknownFieldOfTheSidecarOnlyLeavesANote) {
  write("s.json", R"({"near": 0.5, "upp": "y"})");
  EXPECT_EQ(find().near_z, 0.5f);
  EXPECT_THAT(notes_, testing::ElementsAre(
                          AllOf(HasSubstr("s.json"), HasSubstr("'upp'"), HasSubstr("start_pose"))));
}

TEST_F(Hints, UnusableCameraFilesOnlyLeaveANote) {
  write("cameras.json", R"([{"position": [0, 0], "rotation": []}])");
  EXPECT_EQ(find().source, "estimated");
  ASSERT_EQ(notes_.size(), 1u);
  EXPECT_THAT(notes_[0], HasSubstr("cameras.json: [0].position"));
  write("s.json", R"({"near": -1})");
  EXPECT_THAT(input_error([&] { find(); }), HasSubstr("s.json: near"));
}

TEST_F(Hints, WrittenSidecarsReadBackTheSame) {
  write("cameras.json", cameras_json);
  const SceneHints before = find();
  write_sidecar(before, folder_ / "s.json");
  std::filesystem::remove(folder_ / "cameras.json");
  const SceneHints after = find();
  expect_near(after.up, before.up);
  expect_near(after.start_pose.position, before.start_pose.position);
  EXPECT_LT(angle_between(after.start_pose.orientation, before.start_pose.orientation), 1e-5f);
  EXPECT_EQ(after.near_z, before.near_z);
  expect_near(after.focus, before.focus);
  expect_near(after.limits.min, before.limits.min);
}

using JsonFiles = FolderTest;

TEST_F(JsonFiles, LargerThanTheirLimitAreRefused) {
  // Files of that size without a byte on the disk.
  const auto error = [&](std::uint64_t bytes, const std::function<void(const ByteSource&)>& read) {
    const auto path = write("large.json", "");
    std::filesystem::resize_file(path, bytes);
    return input_error([&] { read(FileSource(path)); });
  };
  const auto read_meta = [&](const ByteSource&) {
    parse_sog_meta(FolderFiles(folder_.path()), "large.json");
  };
  const auto expect_limit = [&](std::uint64_t bytes, const auto& read) {
    EXPECT_THAT(error(bytes, read), HasSubstr("is not valid JSON")) << "it was read";
    EXPECT_THAT(error(bytes + 1, read), HasSubstr(fmt::format("at most {} make sense", bytes)));
  };
  constexpr std::uint64_t mib = 1 << 20;
  expect_limit(4 * mib, read_meta);
  expect_limit(4 * mib, read_sidecar);
  expect_limit(16 * mib, read_cameras_json);
  expect_limit(16 * mib, read_transforms_json);
  expect_limit(32 * mib, read_lod_tree);
}

TEST_F(JsonFiles, OfMoreValuesThanFitIntoMemoryAreRefused) {
  const auto read = [](std::size_t zeros) {
    std::string text = "[0";
    for (std::size_t i = 1; i < zeros; ++i) text += ",0";
    text += "]";
    return read_json(MemorySource("many.json", bytes_of(text)), text.size()).size();
  };
  EXPECT_EQ(read((1 << 20) - 2), (1u << 20) - 2) << "the array itself counts twice";
  EXPECT_THAT(input_error([&] { read((1 << 20) - 1); }),
              AllOf(HasSubstr("many.json"), HasSubstr("more than 1048576 values")));
}

TEST_F(JsonFiles, NestedDeeperThanTheStackMayTakeAreRefused) {
  const auto read = [](std::size_t depth) {
    const std::string text = std::string(depth, '[') + std::string(depth, ']');
    return read_json(MemorySource("deep.json", bytes_of(text)), text.size());
  };
  EXPECT_NO_THROW(read(256));
  EXPECT_THAT(input_error([&] { read(257); }), HasSubstr("nested deeper than 256"));
}

}  // namespace
}  // namespace catgs::test
