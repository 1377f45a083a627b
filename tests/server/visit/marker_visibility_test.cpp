#include "server/visit/marker_visibility.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

/// An opaque wall of 4 x 4 units in the plane z = 3, seen from the origin.
SurfacePoints wall() {
  GaussianCloud cloud;
  cloud.resize(41 * 41, 0);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const auto at = static_cast<float>(i % 41), row = static_cast<float>(i / 41);
    cloud.mean[i] = {0.1f * at - 2.0f, 0.1f * row - 2.0f, 3.0f};
    cloud.scale[i] = {0.1f, 0.1f, 0.001f};
    cloud.rotation[i] = {1.0f, 0.0f, 0.0f, 0.0f};
    cloud.opacity[i] = 0.95f;
  }
  ThreadPool pool(1);
  return SurfacePoints(cloud, pool);
}

class MarkerVisibilityTest : public testing::Test {
 protected:
  using Hidden = std::optional<std::vector<std::uint32_t>>;  // none: nothing new

  Hidden look_from(const glm::vec3& position, float view_height = 0.0f) {
    PoseSample camera;
    camera.view_height = view_height;
    camera.world_from_camera.position = position;
    const auto said = markers.test(surface, camera, clip, now += 250ms);
    EXPECT_EQ(said ? said->id : 7u, 7u);
    return said ? Hidden(said->indices) : std::nullopt;
  }
  static Hidden indices(std::vector<std::uint32_t> hidden) { return hidden; }

  const SurfacePoints surface = wall();
  TimePoint now = TimePoint{} + 1h;
  ClipBox clip;
  MarkerVisibility markers;
};

const glm::vec3 in_front(0.0f, 0.0f, 0.0f);

TEST_F(MarkerVisibilityTest, MarkersBehindAWallAreHiddenUntilTheCameraIsBeyondIt) {
  markers.watch({7, {{0, 0, 2}, {0, 0, 3}, {0, 0, 5}, {9, 0, 5}, {0, 0, -1}}});
  EXPECT_EQ(look_from(in_front), indices({2})) << "that on the wall and that beside it are seen";
  EXPECT_FALSE(look_from({0.01f, 0.0f, 0.0f})) << "nothing is new";
  EXPECT_EQ(look_from({0.0f, 0.0f, 3.5f}), indices({}));
  EXPECT_EQ(look_from({0.0f, 0.0f, 1.0f}), indices({2}));
  markers.watch({7, {}});
  EXPECT_FALSE(look_from(in_front));
}

TEST_F(MarkerVisibilityTest, APlaneThatCutsTheWallOffUncoversMarkers) {
  markers.watch({7, {{0, 0, 5}}});
  EXPECT_EQ(look_from(in_front), indices({0}));
  clip = clip_plane({0, 0, -2}, -8);  // draws what has z > 4
  EXPECT_EQ(look_from(in_front), indices({}));
  clip = clip_plane({0, 0, -2}, -4);  // z > 2: the wall is drawn
  EXPECT_EQ(look_from(in_front), indices({0}));
  clip = clip_plane({0, 0, 2}, 12);  // z < 6: the camera and the wall are drawn
  EXPECT_FALSE(look_from(in_front));
  clip = oriented_box({0, 0, 2}, {1, 0, 0, 0}, {1, 1, 0.5f});  // before the wall
  EXPECT_EQ(look_from(in_front), indices({}));
}

TEST_F(MarkerVisibilityTest, ParallelRaysMeetWhatIsInFrontOfEachMarker) {
  markers.watch({7, {{1.5f, 0, 9}, {5, 0, 9}}});
  EXPECT_EQ(look_from(in_front), indices({0, 1})) << "rays to one point pass through the wall";
  EXPECT_EQ(look_from(in_front, 8.0f), indices({0})) << "the second one is beside the wall";
}

TEST_F(MarkerVisibilityTest, RaysAreLimitedWhateverTheClientSends) {
  Markers many{7, std::vector<glm::vec3>(256, glm::vec3(0, 0, 5))};
  markers.watch(many);
  EXPECT_FALSE(look_from(in_front)) << "the budget is over before all were tested";
  int looks = 1;
  Hidden hidden;
  for (; !hidden; ++looks) {
    hidden = look_from(in_front);
    ASSERT_LT(looks, 100);
  }
  EXPECT_EQ(hidden->size(), 256u);
  EXPECT_GE(looks, 14) << "60 a second after the first 32";
  for (int i = 0; i < 1000; ++i) {  // another set takes no other budget
    markers.watch(many);
    PoseSample camera;
    EXPECT_FALSE(markers.test(surface, camera, clip, now));
  }
}

}  // namespace
}  // namespace catgs
