// Displays, made again after the run and judged by exact pictures.
#include "tests/load/display.h"

#include <numbers>

#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>

#include "render_core/synth/synth.h"
#include "tests/load/display_check.h"
#include "tests/load/metrics.h"
#include "tests/load/overscan.h"
#include "tests/load/unpacked_depths.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::load {
namespace {

using nlohmann::json;

Eye eye_of(const json& eye) {
  const auto p = eye.at("position").get<std::array<float, 3>>();
  const auto q = eye.at("orientation").get<std::array<float, 4>>();
  return {{{p[0], p[1], p[2]}, glm::quat(q[3], q[0], q[1], q[2])}, eye.at("fov_y_rad")};
}

// tests/web_client/warp.test.ts holds the page's warp to the same numbers.
TEST(Warp, IsThatOfTheSharedNumbers) {
  std::ifstream file(CATGS_WARP_GOLDEN);
  const json golden = json::parse(file);
  for (const json& warp : golden.at("warps")) {
    SCOPED_TRACE(warp.at("name"));
    const json& distance = warp.at("distance");
    const glm::dmat3 m = warp_matrix(
        eye_of(warp.at("picture")), eye_of(warp.at("view")), warp.at("picture_aspect"),
        warp.at("view_aspect"),
        distance.is_null() ? std::numeric_limits<double>::infinity() : distance.get<double>());
    for (int i = 0; i < 9; ++i) EXPECT_NEAR(m[i / 3][i % 3], warp.at("matrix")[i], 1e-5) << i;
    const auto corner = warped(m, {1.0, -1.0});
    ASSERT_EQ(corner.has_value(), !warp.at("corner").is_null());
    const glm::dvec2 reached = reach(m);
    for (int i = 0; i < 2; ++i) {
      EXPECT_NEAR(corner.value_or(glm::dvec2(0.0))[i],
                  corner ? warp.at("corner")[i].get<double>() : 0.0, 1e-5);
      EXPECT_NEAR(reached[i], warp.at("reach")[i], 1e-5);
    }
    EXPECT_NEAR(uncovered_share(m), warp.at("uncovered"), 1e-6);
  }
}

// tests/web_client/depth_mesh.test.ts holds the page's mesh to the same numbers.
TEST(DepthWarp, MeshIsThatOfTheSharedNumbers) {
  std::ifstream file(CATGS_WARP_GOLDEN);
  const json mesh = json::parse(file).at("mesh");
  const Depths depths{{mesh.at("columns"), mesh.at("rows")}, mesh.at("inverse_depths")};
  EXPECT_NEAR(median_distance(depths), mesh.at("median_distance").get<double>(), 1e-5);
  const std::vector<MeshPoint> points =
      mesh_points(depths, eye_of(mesh.at("picture")), eye_of(mesh.at("view")),
                  mesh.at("picture_aspect"), mesh.at("view_aspect"));
  ASSERT_EQ(points.size(), mesh.at("points").size());
  for (std::size_t i = 0; i < points.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(points[i].view[axis], mesh.at("points")[i][axis].get<double>(), 1e-5) << i;
}

/// A picture of one line: red on the left half, green on the right.
const Image halves{{4, 1}, {1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0}};

TEST(DepthWarp, PicturesStayWhereTheyAreForAStillCamera) {
  const Eye eye{{}, 1.0f};
  const Depths depths{{2, 1}, {1.0f, 0.1f}};
  const Image seen = warp_by_depths(halves, depths, eye, eye, 4.0, {4, 1});
  for (std::size_t i = 0; i < seen.rgb.size(); ++i)
    EXPECT_NEAR(seen.rgb[i], halves.rgb[i], 1e-5f) << i;
}

TEST(DepthWarp, NearThingsMoveFartherAndCoverFarOnes) {
  constexpr float half_fov = 0.5f;
  const Eye picture{{}, 2.0f * half_fov};
  Eye view = picture;
  const float half_width = 4.0f * std::tan(half_fov);  // at depth 1
  view.world_from_camera.position.x = -0.25f * half_width;
  // The left half is at depth 1: it moves by a quarter of the half width, the right half does not.
  const Image seen = warp_by_depths(halves, {{2, 1}, {1.0f, 0.0f}}, picture, view, 4.0, {64, 1});
  const auto red = [&](int x) { return seen.rgb[static_cast<std::size_t>(3 * x)]; };
  EXPECT_NEAR(red(20), 1.0f, 1e-5f);
  EXPECT_NEAR(red(63), 0.0f, 1e-5f);
  // Half way between the depths, the edge has moved half as far as what is near.
  EXPECT_GT(red(35), 0.5f);
  EXPECT_LT(red(36), 0.5f);
  // From the other side, the near half leaves what it covered. Nothing is empty there.
  view.world_from_camera.position.x *= -1.0f;
  const Image behind = warp_by_depths(halves, {{2, 1}, {1.0f, 0.0f}}, picture, view, 4.0, {64, 1});
  for (int x = 0; x < 64; ++x) {
    const float* at = &behind.rgb[static_cast<std::size_t>(3 * x)];
    EXPECT_NEAR(at[0] + at[1], 1.0f, 1e-4f) << x;
  }
}

TEST(Warp, SamplesPixelCentresAndRepeatsTheBorder) {
  const Image picture{{2, 1}, {0.0f, 0.0f, 0.0f, 1.0f, 1.0f, 1.0f}};
  const glm::dmat3 unmoved(1.0);
  EXPECT_EQ(warp_image(picture, unmoved, {2, 1}).rgb, picture.rgb);
  const Image wide = warp_image(picture, unmoved, {4, 1});
  constexpr float expected[] = {0.0f, 0.25f, 0.75f, 1.0f};
  for (int x = 0; x < 4; ++x) EXPECT_FLOAT_EQ(wide.rgb[3 * x], expected[x]) << x;
}

struct Turn {
  double yaw_rad, pitch_rad, period_s;

  [[nodiscard]] Pose at(double s) const {
    const double phase = 2.0 * std::numbers::pi * std::max(0.0, s) / period_s;
    const glm::dquat yaw = glm::angleAxis(yaw_rad * std::sin(phase), glm::dvec3(0, -1, 0));
    const glm::dquat pitch = glm::angleAxis(pitch_rad * std::sin(2.0 * phase), glm::dvec3(1, 0, 0));
    return {glm::vec3(0.0f), glm::quat(yaw * pitch)};
  }
};

// tests/web_client/display.test.ts holds the page to the same choices.
TEST(Overscan, IsThatOfTheSharedTurns) {
  std::ifstream file(CATGS_WARP_GOLDEN);
  const json golden = json::parse(file);
  Overscan overscan;
  json changes = json::array();
  double begin_s = 0.0;
  int refresh = 0;
  for (const json& part : golden.at("turns")) {
    const Turn turn{part.at("yaw_rad"), part.at("pitch_rad"), part.at("period_s")};
    const int seconds = part.at("seconds");
    for (int i = 1; i <= 60 * seconds; ++i, ++refresh) {
      const double s = i / 60.0;
      const auto now_us = static_cast<std::int64_t>(std::llround((begin_s + s) * 1e6));
      overscan.moved(now_us, turn.at(s));
      const glm::dvec2 sides = overscan.sides();
      const Eye picture{turn.at(s - part.at("lag_s").get<double>()), widened_fov(1.0f, sides.y)};
      if (overscan.drawn(picture, 640.0 * sides.x / (360.0 * sides.y), {turn.at(s), 1.0f},
                         16.0 / 9.0, std::numeric_limits<double>::infinity(), now_us))
        changes.push_back(
            {{"refresh", refresh}, {"x", overscan.sides().x}, {"y", overscan.sides().y}});
    }
    begin_s += seconds;
  }
  EXPECT_EQ(changes, golden.at("overscans")) << changes;
}

TEST(Overscan, MakesEvenPicturesWhosePixelsARestSees) {
  struct Case {
    glm::dvec2 factors;
    glm::ivec2 view_px;
    glm::dvec2 picture_px;
  };
  for (const auto& [factors, view_px, picture_px] :
       {Case{{1.26, 1.12}, {640, 360}, {806, 404}}, Case{{1.6, 1.26}, {1366, 768}, {2186, 968}},
        Case{{1.0, 1.0}, {639, 361}, {639, 361}}}) {
    const glm::dvec2 sides = even_overscan(factors, view_px);
    EXPECT_EQ(sides * glm::dvec2(view_px), picture_px) << picture_px.x;
    EXPECT_LT(glm::length(sides - factors), 4e-3) << picture_px.x;
  }
}

/// A log of refreshes 10 ms apart: the frame of each one; negative at rest.
DisplayLog shown(const std::vector<int>& frames) {
  DisplayLog log;
  log.frames.resize(100);
  for (std::size_t i = 0; i < log.frames.size(); ++i)
    log.frames[i].pose_us = static_cast<std::int64_t>(i) * 10'000;
  for (const int frame : frames) {
    DisplayLog::Refresh& refresh = log.refreshes.emplace_back();
    refresh.time_us = static_cast<std::int64_t>(log.refreshes.size()) * 10'000;
    refresh.frame = static_cast<std::size_t>(std::abs(frame));
    refresh.rest = frame < 0 ? 1 : 0;
  }
  return log;
}

std::vector<int> repeated(int frame, int refreshes) {
  return std::vector<int>(static_cast<std::size_t>(refreshes), frame);
}

std::vector<int> joined(std::initializer_list<std::vector<int>> parts) {
  std::vector<int> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

TEST(Display, FreezesAreLongIntervalsWhileTheCameraMoves) {
  EXPECT_THAT(freezes_ms(shown({1, 2, 3, 4, 5, 6})), IsEmpty());
  EXPECT_THAT(freezes_ms(shown(joined({{1, 2, 3}, repeated(4, 15), {5}}))), IsEmpty())
      << "150 ms is under 10 + 150";
  EXPECT_THAT(freezes_ms(shown(joined({{1, 2, 3}, repeated(4, 40), {5}}))), ElementsAre(400.0));
  EXPECT_THAT(freezes_ms(shown(joined({{1, 2, 3}, repeated(4, 40)}))), ElementsAre(390.0))
      << "one without an end";
  EXPECT_THAT(freezes_ms(shown(joined({{1, 2, 3}, repeated(4, 40), repeated(-4, 5)}))),
              ElementsAre(400.0))
      << "one until a rest";
  EXPECT_THAT(freezes_ms(shown(joined({{1, 2, 3}, repeated(-4, 40), {4, 5}}))), IsEmpty())
      << "a picture at rest stays";
}

TEST(Display, LogsOfARunShareItsRoom) {
  DisplayLog a, b;
  a.room_bytes = b.room_bytes = std::make_shared<std::size_t>(100);
  EXPECT_TRUE(a.take_room(60));
  EXPECT_FALSE(b.take_room(60));
  EXPECT_FALSE(b.take_room(1)) << "the frames after a lost one cannot be decoded";
  EXPECT_TRUE(a.take_room(40));
  EXPECT_FALSE(a.take_room(1));
}

TEST(Display, ARestDoesNotAgeThePose) {
  EXPECT_THAT(pose_ages_ms(shown({0, 1, 1, 2})), ElementsAre(10.0, 10.0, 20.0, 20.0));
  EXPECT_THAT(pose_ages_ms(shown({0, -1, -1, -1, 1, 1})),
              ElementsAre(10.0, testing::IsNan(), testing::IsNan(), testing::IsNan(), 10.0, 20.0));
}

/// A client that sees a small city: one frame, and one refresh from another camera.
class SmallCity : public ::testing::Test {
 protected:
  static constexpr const char* scene = "synth:city:20000";
  static constexpr glm::ivec2 view_px{320, 180}, picture_px{404, 202};
  static inline const glm::dvec2 overscan = even_overscan({1.26, 1.12}, view_px);

  static void SetUpTestSuite() {
    const Scene city = synthesize(SynthKind::city, 20'000, 1);
    start_ = {city.hints.start_pose, 1.0f};
    near_z_ = city.hints.near_z;
    EncoderSettings settings;
    settings.size_px = picture_px;
    settings.bitrate_kbps = 50'000;
    const auto encoder = make_encoder(EncoderKind::x264, settings);
    const auto renderer = make_renderer(std::make_shared<const GaussianCloud>(city.cloud)).renderer;
    const auto view = renderer->make_view({Pipeline::exact, PixelFormat::i420});
    FrameRequest request;
    const float fov_y_rad = widened_fov(start_.fov_y_rad, overscan.y);
    request.camera = make_camera(start_.world_from_camera, picture_px,
                                 focal_from_fov_y(fov_y_rad, picture_px.y), near_z_);
    request.depth_cells = depth_cells_of(picture_px);
    FrameView frame;
    ASSERT_TRUE(view->render(request, frame).ok());
    EncodedFrame encoded;
    ASSERT_TRUE(encoder->encode(frame, true, encoded).ok);
    depths_ = {frame.depths.cells, unpack(pack(frame.depths)).value()};
    frame_ = {.eye = {start_.world_from_camera, fov_y_rad},
              .size_px = picture_px,
              .pose_us = 0,
              .codec = Codec::h264,
              .first = true,
              .bitstream = encoded.bytes};
  }

  static Pose turned(float degrees) {
    Pose pose = start_.world_from_camera;
    pose.orientation = pose.orientation * glm::angleAxis(glm::radians(degrees), glm::vec3(0, 1, 0));
    return pose;
  }

  /// A run in which a visitor who has turned away by 4 degrees sees the frame.
  static RunReport run() {
    RunReport report;
    GroupReport& group = report.groups.emplace_back();
    group.name = "city/turned";
    group.series = std::make_unique<TimeSeries>(0);
    group.sessions.push_back(std::make_unique<SessionReport>(60.0, group.series.get()));
    DisplayLog& log = group.sessions[0]->display.emplace();
    log.view_px = view_px;
    log.fov_y_rad = start_.fov_y_rad;
    log.near_z = near_z_;
    log.scene_id = "city";
    log.frames = {frame_};
    DisplayLog::Refresh& refresh = log.refreshes.emplace_back();
    refresh.camera = turned(4.0f);
    refresh.distance = std::numeric_limits<double>::infinity();
    refresh.overscan = overscan.y;
    return report;
  }

  template <typename Change>
  static JudgedRefresh judged(Change change) {
    RunReport report = run();
    DisplayLog& log = *report.groups[0].sessions[0]->display;
    change(log.frames[0], log.refreshes[0]);
    check_displays({.scenes = {scene}}, report);
    return report.groups[0].sessions[0]->judged.at(0);
  }

  inline static Eye start_;
  inline static float near_z_ = 0.2f;
  inline static DisplayLog::Frame frame_;
  inline static Depths depths_;
};

using Frame = DisplayLog::Frame;
using Refresh = DisplayLog::Refresh;

TEST_F(SmallCity, WarpedPicturesAreNearTheExactOne) {
  const JudgedRefresh unmoved =
      judged([](Frame&, Refresh& refresh) { refresh.camera = start_.world_from_camera; });
  const JudgedRefresh warp = judged([](Frame&, Refresh&) {});
  EXPECT_GE(unmoved.ssim, 0.98);
  EXPECT_GE(warp.ssim, 0.97);
  EXPECT_GE(warp.psnr_db, 32.0);
  EXPECT_EQ(warp.uncovered, 0.0);
}

TEST_F(SmallCity, DepthsShowWhatAStepOfTheCameraMoves) {
  const auto after_a_step = [](bool by_depths, glm::vec3 step) {
    return judged([&](Frame& frame, Refresh& refresh) {
      refresh.camera.position += refresh.camera.orientation * step;
      if (by_depths) frame.depths = depths_;
    });
  };
  for (const glm::vec3 step : {glm::vec3(0.3f, 0, 0), glm::vec3(0, 0.3f, 0), glm::vec3(0, 0, 1)}) {
    const JudgedRefresh turned_only = after_a_step(false, step), warp = after_a_step(true, step);
    EXPECT_GE(warp.ssim, turned_only.ssim + 0.03);
    EXPECT_GE(warp.psnr_db, turned_only.psnr_db + 2.0);
  }
  EXPECT_GE(after_a_step(true, glm::vec3(0)).ssim, 0.97);  // turns alone are exact as before
}

TEST_F(SmallCity, WrongWarpsAndPosesAreSeen) {
  const double right = judged([](Frame&, Refresh&) {}).ssim;
  const auto expect_worse = [&](const char* what, auto change) {
    const JudgedRefresh wrong = judged(change);
    EXPECT_LT(wrong.ssim, right - 0.03) << what;
    EXPECT_LT(wrong.psnr_db, 30.0) << what;
  };
  expect_worse("no warp", [](Frame&, Refresh& refresh) { refresh.distance = 0.0; });
  expect_worse("the other way round",
               [](Frame& frame, Refresh&) { frame.eye.world_from_camera = turned(8.0f); });
  expect_worse("a pose that is half a degree off",
               [](Frame& frame, Refresh&) { frame.eye.world_from_camera = turned(0.5f); });
  expect_worse("the field of view without overscan",
               [](Frame& frame, Refresh&) { frame.eye.fov_y_rad = start_.fov_y_rad; });
}

TEST_F(SmallCity, WorstRefreshesAreWritten) {
  const test::TemporaryFolder folder;
  RunReport report = run();
  check_displays({.scenes = {scene}, .worst_folder = folder / "worst"}, report);
  EXPECT_TRUE(std::filesystem::exists(folder / "worst/city-turned-1-shown.png"));
  EXPECT_TRUE(std::filesystem::exists(folder / "worst/city-turned-1-exact.png"));
  EXPECT_GE(value_of(collect_metrics(report, {}), "city/turned.display_ssim_min"), 0.97);
}

}  // namespace
}  // namespace catgs::load
