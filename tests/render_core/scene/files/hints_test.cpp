#include "render_core/scene/files/hints.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/files/view_sample.h"
#include "render_core/scene/formats/camera_list.h"
#include "render_core/scene/formats/json_field.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/streamed_sog.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/surface_clouds.h"

namespace catgs::test {
namespace {

constexpr glm::vec3 down_y(0, -1, 0);

void expect_near(const glm::vec3& a, const glm::vec3& b, float tolerance = 1e-5f) {
  EXPECT_LT(glm::distance(a, b), tolerance)
      << a.x << " " << a.y << " " << a.z << " against " << b.x << " " << b.y << " " << b.z;
}

glm::vec3 forward(const Pose& pose) { return pose.orientation * glm::vec3(0, 0, 1); }
glm::vec3 up(const Pose& pose) { return pose.orientation * glm::vec3(0, -1, 0); }

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
  EXPECT_EQ(parse_sidecar(R"({"model": "2dgs"})").model, SplatModel::surfels);
  EXPECT_EQ(parse_sidecar(R"({"model": "antialiased"})").model, SplatModel::antialiased);
  EXPECT_EQ(parse_sidecar("{}").model, std::nullopt);
}

TEST(Sidecar, TextsForVisitorsAreRead) {
  const SceneAbout about = parse_sidecar(R"({
    "title": "The hall", "credits": "Ada\u202e", "licence": "CC-BY-4.0", "mode": "walk",
    "background": "#0a10FF", "metres_per_unit": 0.25})")
                               .about;
  EXPECT_EQ(about.title, "The hall");
  EXPECT_EQ(about.credits, "Ada\\xe2\\x80\\xae") << "its direction does not turn";
  EXPECT_EQ(about.licence, "CC-BY-4.0");
  EXPECT_EQ(about.mode, CameraMode::walk);
  EXPECT_EQ(about.background_rgb, 0x0a10ffu);
  EXPECT_EQ(about.metres_per_unit, 0.25f);
  EXPECT_EQ(colour_of(about.background_rgb), glm::vec3(10, 16, 255) / 255.0f);
  EXPECT_EQ(parse_sidecar("{}").about, SceneAbout());
}

TEST(Sidecar, TextsForVisitorsMayBeInSeveralLanguages) {
  const SceneAbout about = parse_sidecar(R"({"title": "The hall", "translations": {
    "de": {"title": "Die Halle", "credits": "Ada\u202e"}, "fr": {"title": "La salle"}}})")
                               .about;
  EXPECT_EQ(about.translations, (std::vector<SceneWords>{{"de", "Die Halle", "Ada\\xe2\\x80\\xae"},
                                                         {"fr", "La salle"}}));
}

TEST(Sidecar, ErrorsNameTheField) {
  struct Text {
    std::string text;
    const char* where;
  };
  const std::string pose = R"({"start_pose": {"position": [0, 0, 0])";
  std::vector<Text> texts = {
      {R"({"title": 1})", "title"},
      {R"({"credits": ")" + std::string(801, 'a') + "\"}", "credits"},
      {R"({"translations": []})", "translations"},
      {R"({"translations": {"d_": {}}})", "translations"},
      {R"({"translations": {"de": {"licence": "MIT"}}})", "translations.de"},
      {R"({"translations": {"de": {"title": ")" + std::string(801, 'a') + "\"}}}",
       "translations.de.title"},
      {R"({"mode": "swim"})", "mode"},
      {R"({"model": "3dgs"})", "model"},
      {R"({"up": )", "byte 8"},
      {"[]", ""},
      {R"({"up": "w"})", "up"},
      {R"({"up": [0, 0, 0]})", "up"},
      {R"({"near": 0})", "near"},
      {R"({"near": 1.1e9})", "near"},
      {R"({"focus": [0, -1.1e9, 0]})", "focus"},
      {R"({"near": 1e99})", "near"},
      {R"({"focus": [1, 2, "c"]})", "focus[2]"},
      {R"({"limits": {"min": [0, 0, 0], "max": [1, 0, 1]}})", "limits"},
      {pose + "}}", "start_pose"},
      {pose + R"(, "orientation": [1, 1, 1, 1]}})", "start_pose.orientation"},
  };
  for (const char* colour : {"red", "#12345", "#12345g", "#-12345", "1234567"})
    texts.push_back({fmt::format(R"({{"background": "{}"}})", colour), "background"});
  for (const char* metres : {"0", "-1", "1e7", "\"1 m\""})
    texts.push_back({fmt::format(R"({{"metres_per_unit": {}}})", metres), "metres_per_unit"});
  for (const Text& t : texts)
    EXPECT_EQ(refusal_of([&] { parse_sidecar(t.text); }), (Refusal{"city.json", t.where}))
        << t.text;
  EXPECT_EQ(input_error([] { parse_sidecar(R"({"mode": "swim"})"); }),
            "city.json: mode: is not a mode (write orbit, fly, walk)");
}

class Hints : public FolderTest {
 protected:
  SceneHints find() {
    return find_hints([&] { return view_sample(cloud_); },
                      {.sidecar = folder_ / "s.json",
                       .cameras = folder_ / "cameras.json",
                       .transforms = folder_ / "transforms.json",
                       .orbit = orbit_,
                       .usual_up = usual_up_},
                      up_, notes_, pool_);
  }
  UsualUp usual_up_ = UsualUp::minus_y;
  std::optional<OrbitLimits> orbit_;
  std::shared_ptr<ThreadPool> pool_ = std::make_shared<ThreadPool>(2);
  std::optional<glm::vec3> up_;
  GaussianCloud cloud_ = ball(1.0f);
  std::vector<std::string> notes_;
};

TEST_F(Hints, UpIsDoubtfulUntilSomebodySaysIt) {
  EXPECT_FALSE(find().up_is_doubtful);
  usual_up_ = UsualUp::either_y;
  EXPECT_TRUE(find().up_is_doubtful);
  for (const auto& [sidecar, doubtful] :
       {std::pair{R"({"near": 0.1})", true}, std::pair{R"({"up": "+y"})", false},
        std::pair{R"({"start_pose": {"position": [0, 0, -4], "look_at": [0, 0, 0]}})", false}}) {
    write("s.json", sidecar);
    EXPECT_EQ(find().up_is_doubtful, doubtful) << sidecar;
  }
  write("s.json", "{}");
  up_ = down_y;
  EXPECT_FALSE(find().up_is_doubtful);
}

// With y down, heights above the focus are below it in y.
TEST_F(Hints, AnOrbitNarrowsTheLimits) {
  up_ = down_y;
  const SceneHints free = find();
  ASSERT_NE(free.limits.max.y, free.focus.y);
  orbit_ = OrbitLimits{0.1f, 0.5f, 2.0f};
  const SceneHints hints = find();
  EXPECT_NEAR(hints.limits.max.y, hints.focus.y - 2.0f * std::sin(0.1f), 1e-4f);
  const glm::vec3 from_focus = hints.start_pose.position - hints.focus;
  const float distance = glm::length(from_focus);
  EXPECT_GE(distance, 2.0f - 1e-4f);
  const float elevation = std::asin(-from_focus.y / distance);
  EXPECT_GE(elevation, 0.1f - 1e-4f);
  EXPECT_LE(elevation, 0.5f + 1e-4f);
  expect_near(forward(hints.start_pose), -from_focus / distance, 1e-4f);
  EXPECT_EQ(hints.limits.min.x, std::min(free.limits.min.x, hints.start_pose.position.x));
  EXPECT_EQ(hints.source, "estimated, with the orbit of its file");

  orbit_ = OrbitLimits{-1.570796f, 1.570796f, 0.0f};  // anywhere
  EXPECT_EQ(find().start_pose.position, free.start_pose.position);

  write("s.json", R"({"limits": {"min": [-9, -9, -9], "max": [9, 9, 9]}})");
  orbit_ = OrbitLimits{0.1f, 0.5f, 2.0f};
  EXPECT_EQ(find().limits.max.y, 9.0f);
}

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

TEST_F(Hints, UpFromTheCommandLineIsForScenesWhoseSidecarNamesNone) {
  up_ = glm::vec3(1, 0, 0);
  write("cameras.json", cameras_json);
  write("s.json", R"({"near": 0.5})");
  expect_near(find().up, {1, 0, 0});
  write("s.json", R"({"up": "+z"})");
  expect_near(find().up, {0, 0, 1});
}

TEST_F(Hints, ScaleIsTheSameWhereverVisitsBegin) {
  const float scale = find().scale;
  EXPECT_GT(scale, 0.5f);
  write("s.json", R"({"start_pose": {"position": [0, 0, -1.1], "look_at": [0, 0, -1]}})");
  EXPECT_EQ(find().scale, scale);
}

TEST_F(Hints, AnUnknownFieldOfTheSidecarOnlyLeavesANote) {
  write("s.json", R"({"near": 0.5, "upp": "y"})");
  EXPECT_EQ(find().near_z, 0.5f);
  EXPECT_THAT(notes_, testing::ElementsAre(testing::HasSubstr("'upp'")));
}

TEST_F(Hints, UnusableCameraFilesOnlyLeaveANote) {
  write("cameras.json", R"([{"position": [0, 0], "rotation": []}])");
  EXPECT_EQ(find().source, "estimated");
  ASSERT_EQ(notes_.size(), 1u);
  EXPECT_EQ(notes_[0], "not used: " + (folder_ / "cameras.json").string() +
                           ": [0].position: is not an array of 3 numbers");
  write("s.json", R"({"near": -1})");
  EXPECT_EQ(refusal_of([&] { find(); }), (Refusal{(folder_ / "s.json").string(), "near"}));
}

TEST_F(Hints, WrittenSidecarsReadBackTheSame) {
  write("cameras.json", cameras_json);
  SceneHints before = find();
  before.about = {"Hall", "Ada", "MIT", CameraMode::fly, 0x00ff01};
  write_sidecar(before, folder_ / "s.json");
  std::filesystem::remove(folder_ / "cameras.json");
  const SceneHints after = find();
  expect_near(after.up, before.up);
  expect_near(after.start_pose.position, before.start_pose.position);
  EXPECT_LT(angle_between(after.start_pose.orientation, before.start_pose.orientation), 1e-5f);
  EXPECT_EQ(after.near_z, before.near_z);
  expect_near(after.focus, before.focus);
  expect_near(after.limits.min, before.limits.min);
  EXPECT_EQ(after.about, before.about);
}

using JsonFiles = FolderTest;

TEST_F(JsonFiles, FilesAboveTheirLimitAreRefused) {
  // Files of that size without a byte on the disk.
  const auto path = write("large.json", "");
  const auto refusal = [&](std::uint64_t bytes, const auto& read) {
    std::filesystem::resize_file(path, bytes);
    return refusal_of([&] { read(FileSource(path)); });
  };
  const auto read_meta = [&](const ByteSource&) {
    parse_sog_meta(FolderFiles(folder_.path()), "large.json");
  };
  const auto expect_limit = [&](std::uint64_t bytes, const auto& read) {
    EXPECT_EQ(refusal(bytes, read), (Refusal{path.string(), "byte 1"})) << "it was read";
    EXPECT_EQ(refusal(bytes + 1, read), (Refusal{path.string(), ""}));
  };
  constexpr std::uint64_t mib = 1 << 20;
  expect_limit(4 * mib, read_meta);
  expect_limit(4 * mib, [](const ByteSource& file) { read_sidecar(file); });
  expect_limit(16 * mib, [](const ByteSource& file) { read_camera_json(file); });
  expect_limit(32 * mib, read_lod_tree);
}

TEST_F(JsonFiles, TooManyValuesAreRefused) {
  const auto read = [](std::size_t zeros) {
    std::string text = "[0";
    for (std::size_t i = 1; i < zeros; ++i) text += ",0";
    text += "]";
    return read_json(MemorySource("many.json", bytes_of(text)), text.size()).size();
  };
  EXPECT_EQ(read((1 << 20) - 2), (1u << 20) - 2) << "the array itself counts twice";
  EXPECT_EQ(refusal_of([&] { read((1 << 20) - 1); }), (Refusal{"many.json", ""}));
}

// In a time that grows as the square of their number, this would take minutes.
TEST_F(JsonFiles, ManyObjectsAreRead) {
  std::string text = "[{}";
  for (int i = 1; i < 500'000; ++i) text += ",{}";
  text += "]";
  EXPECT_EQ(read_json(MemorySource("many.json", bytes_of(text)), text.size()).size(), 500'000u);
}

TEST_F(JsonFiles, DeepNestingIsRefused) {
  const auto read = [](std::size_t depth) {
    const std::string text = std::string(depth, '[') + std::string(depth, ']');
    return read_json(MemorySource("deep.json", bytes_of(text)), text.size());
  };
  EXPECT_NO_THROW(read(256));
  EXPECT_EQ(refusal_of([&] { read(257); }), (Refusal{"deep.json", ""}));
}

}  // namespace
}  // namespace catgs::test
