#include "render_core/scene/edit/edit_scene.h"

#include <memory>
#include <numbers>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>

#include "render_core/reference/reference.h"
#include "render_core/scene/files/tour_places.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {
namespace {

const Placement somewhere{2.5, glm::normalize(glm::dquat(0.3, -0.5, 0.7, 0.2)), {10.0, -4.0, 7.0}};

EditCounts edit(GaussianCloud& cloud, const SceneEdit& edit) {
  ThreadPool pool(2);
  return edit_cloud(cloud, edit, pool, LoadContext(pool));
}

SceneHints some_hints() {
  SceneHints hints;
  hints.up = glm::vec3(0, -1, 0);
  hints.start_pose = look_at(glm::vec3(0.5f, 0.2f, -9.0f), glm::vec3(0.0f));
  hints.near_z = 0.1f;
  hints.limits = {{-1, -2, -3}, {4, 5, 6}};
  hints.focus = {0.5f, 0, 1};
  hints.scale = 3.0f;
  hints.about.title = "Hall";
  return hints;
}

TEST(EditScene, APlacedSceneLooksTheSameFromItsPlacedStart) {
  const auto pool = std::make_shared<ThreadPool>(2);
  const auto draw = [&](const GaussianCloud& cloud, const SceneHints& hints) {
    const auto view =
        make_reference_renderer(std::make_shared<const GaussianCloud>(cloud), pool)->make_view({});
    return render_in(*view,
                     {.camera = make_camera(hints.start_pose, {48, 48}, 60.0f, hints.near_z)})
        .rgb;
  };
  const GaussianCloud before = random_cloud(500, 3);
  GaussianCloud after = before;
  edit(after, {.placement = somewhere});
  const auto picture = draw(before, some_hints());
  EXPECT_GT(psnr_db(picture, draw(after, placed(some_hints(), somewhere))), 70.0);
  // Harmonics that did not turn would show.
  GaussianCloud stiff = after;
  stiff.sh = before.sh;
  EXPECT_LT(psnr_db(picture, draw(stiff, placed(some_hints(), somewhere))), 50.0);
}

TEST(EditScene, PlacingMovesAllHints) {
  const double half = std::numbers::sqrt2 / 2.0;
  const Placement quarter{2.0, {half, half, 0, 0}, {1, 0, 0}};  // about x: y to z, z to -y
  const SceneHints before = some_hints(), after = placed(before, quarter);
  const auto expect_near = [](const glm::vec3& a, const glm::vec3& b) {
    EXPECT_LT(glm::distance(a, b), 1e-5f) << b.x << ' ' << b.y << ' ' << b.z;
  };
  expect_near(after.up, {0, 0, -1});
  expect_near(after.start_pose.position, {2, 18, 0.4f});
  expect_near(after.focus, {2, -2, 0});
  expect_near(after.limits.min, {-1, -12, -4});
  expect_near(after.limits.max, {9, 6, 10});
  EXPECT_FLOAT_EQ(after.near_z, 0.2f);
  EXPECT_FLOAT_EQ(after.scale, 6.0f);
  EXPECT_EQ(after.about, before.about);
  const glm::vec3 forward = before.start_pose.orientation * glm::vec3(0, 0, 1);
  expect_near(after.start_pose.orientation * glm::vec3(0, 0, 1),
              {forward.x, -forward.z, forward.y});
}

TEST(EditScene, PlacingBeyondTheBoundIsRefused) {
  GaussianCloud cloud = random_cloud(10, 0);
  const Placement far{1.0, {1, 0, 0, 0}, {9e8, 0, 0}}, large{1e6, {1, 0, 0, 0}, {0, 0, 0}};
  edit(cloud, {.placement = far});
  const Refusal refusal{"placement", ""};
  EXPECT_EQ(refusal_of([&] { edit(cloud, {.placement = far}); }), refusal);
  SceneHints hints = some_hints();
  hints.focus.x = 1e5f;
  EXPECT_EQ(refusal_of([&] { static_cast<void>(placed(hints, large)); }), refusal);
}

TEST(EditScene, CroppingAfterPlacingIsExact) {
  const GaussianCloud before = random_cloud(2000, 1);
  const CropBox box{{5.0f, -10.0f, 4.0f}, {15.0f, 0.0f, 9.0f}};
  GaussianCloud placed_only = before, cropped = before;
  edit(placed_only, {.placement = somewhere});
  const EditCounts counts = edit(cropped, {.placement = somewhere, .crop = box});
  std::size_t kept = 0;
  for (std::size_t i = 0; i < placed_only.size(); ++i) {
    const glm::vec3& m = placed_only.mean[i];
    bool inside = true;
    for (int k = 0; k < 3; ++k) inside = inside && m[k] >= box.min[k] && m[k] <= box.max[k];
    if (!inside) continue;
    ASSERT_LT(kept, cropped.size());
    EXPECT_EQ(cropped.mean[kept], m);
    EXPECT_EQ(cropped.sh_of(kept)[3], placed_only.sh_of(i)[3]);
    ++kept;
  }
  EXPECT_EQ(cropped.size(), kept);
  EXPECT_EQ(counts.cropped, before.size() - kept);
  EXPECT_GT(kept, 100u);
  // The faces belong to the box.
  GaussianCloud one = random_cloud(1, 0);
  edit(one, {.crop = CropBox{one.mean[0], one.mean[0]}});
  EXPECT_EQ(one.size(), 1u);
}

TEST(EditScene, EmptyEditsChangeNothing) {
  const GaussianCloud before = random_cloud(100, 2);
  GaussianCloud after = before;
  edit(after, {});
  EXPECT_EQ(ply_bytes(after), ply_bytes(before));
}

TEST(EditScene, MergingReachesANumberOrAShare) {
  GaussianCloud number = random_cloud(1000, 0), share = number, neither = number;
  EXPECT_EQ(edit(number, {.merge_to = 300}).merged, 700u);
  EXPECT_EQ(number.size(), 300u);
  edit(share, {.merge_fraction = 0.251});
  EXPECT_EQ(share.size(), 251u);
  edit(neither, {.merge_to = 5000});
  EXPECT_EQ(neither.size(), 1000u);
}

TEST(EditScene, OnlyPlacingAndCroppingWorkOnParts) {
  EXPECT_TRUE((SceneEdit{.placement = somewhere, .crop = CropBox{}}.works_on_parts()));
  EXPECT_FALSE(SceneEdit{.remove_floaters = true}.works_on_parts());
  EXPECT_FALSE(SceneEdit{.keep_fraction = 0.5}.works_on_parts());
  EXPECT_FALSE(SceneEdit{.merge_to = 5}.works_on_parts());
  EXPECT_FALSE(SceneEdit{.merge_fraction = 0.5}.works_on_parts());
}

TEST(TourPlaces, MeasuresMoveAndTheirErrorsGrowWithTheScene) {
  auto fields = nlohmann::ordered_json::parse(
      R"({"measures": [{"title": "Door", "marks": [{"position": [1, 2, 3], "error": 0.25, "depth": [1, 0, 2]}]}]})");
  place_tours(fields, Placement{2.0, {0, 0, 0, 1}, {10, 0, 0}});  // half a turn about z
  const auto& mark = fields["measures"][0]["marks"][0];
  EXPECT_EQ(mark.at("position"), nlohmann::ordered_json({8.0, -4.0, 6.0}));
  EXPECT_EQ(mark.at("error"), 0.5);
  EXPECT_EQ(mark.at("depth"), nlohmann::ordered_json({-2.0, 0.0, 4.0}));
  EXPECT_EQ(fields["measures"][0]["title"], "Door");
}

TEST(TourPlaces, SectionsMoveTurnAndGrowWithTheScene) {
  struct Case {
    glm::vec3 axis;  // of a quarter of a turn
    glm::vec3 up;    // of the placed scene
    double turn;
  };
  for (const auto& [axis, up, turn] :
       {Case{{0, -1, 0}, {0, -1, 0}, 120.0},  // about the vertical
        Case{{1, 0, 0}, {0, 0, -1}, 30.0}, Case{{0, 0, 1}, {1, 0, 0}, -60.0}}) {
    auto stop = nlohmann::ordered_json::parse(
        R"({"view_height": 5, "section": [1, 2, 3, 4, 6, 8, 30], "more": {"section": [1]}})");
    SceneHints hints;
    hints.up = up;
    const glm::dquat rotation = glm::angleAxis(glm::radians(90.0), glm::dvec3(axis));
    place_tours(stop, Placement{2.0, rotation, {10, 0, 0}}, hints);
    EXPECT_EQ(stop["view_height"], 10.0);
    std::vector<double> expected{0, 0, 0, 8, 12, 16, turn};
    const glm::dvec3 centre = 2.0 * (rotation * glm::dvec3(1, 2, 3)) + glm::dvec3(10, 0, 0);
    for (int k = 0; k < 3; ++k) expected[static_cast<std::size_t>(k)] = centre[k];
    EXPECT_THAT(stop["section"].get<std::vector<double>>(),
                ::testing::Pointwise(::testing::DoubleNear(1e-4), expected));
    EXPECT_EQ(stop["more"]["section"], nlohmann::ordered_json({1}));
  }
}

TEST(TourPlaces, StopsMoveAndTurnWithTheScene) {
  auto tours = nlohmann::ordered_json::parse(R"([{"title": "Way", "stops": [
    {"position": [1, 2, 3], "look_at": [0, 0, 4], "marker": [1, 0, 0], "fov_deg": 60},
    {"position": [0, 0, 0], "orientation": [0, 0, 0, 1], "marker": "no place", "more": {"marker": [0, 1, 0]}}
  ]}])");
  const Placement half_turn{2.0, {0, 0, 0, 1}, {10, 0, 0}};  // about z
  place_tours(tours, half_turn);
  const auto& stops = tours[0].at("stops");
  EXPECT_EQ(stops[0].at("position"), nlohmann::ordered_json({8.0, -4.0, 6.0}));
  EXPECT_EQ(stops[0].at("look_at"), nlohmann::ordered_json({10.0, 0.0, 8.0}));
  EXPECT_EQ(stops[0].at("marker"), nlohmann::ordered_json({8.0, 0.0, 0.0}));
  EXPECT_EQ(stops[0].at("fov_deg"), 60);
  EXPECT_EQ(stops[1].at("orientation"), nlohmann::ordered_json({0.0, 0.0, 1.0, 0.0}));
  EXPECT_EQ(stops[1].at("marker"), "no place");
  EXPECT_EQ(stops[1].at("more").at("marker"), nlohmann::ordered_json({10.0, -2.0, 0.0}));
  EXPECT_EQ(tours[0].at("title"), "Way");
}

}  // namespace
}  // namespace catgs::test
