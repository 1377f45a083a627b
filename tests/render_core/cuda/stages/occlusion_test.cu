// Limits of depth from the last frame's ends, against what they mean.

#include <cmath>
#include <span>

#include "render_core/cuda/occlusion.cuh"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

constexpr glm::ivec2 size_px{200, 120};  // parts of the last tiles lie outside
constexpr float unknown = std::numeric_limits<float>::infinity();

/// Ends by parts of the picture, row by row.
class OcclusionStage : public StageTest {
 protected:
  OcclusionStage() : shape_(picture_shape(size_px)) {}

  static constexpr int parts_x = (size_px.x + part_side_px - 1) / part_side_px;
  static constexpr int parts_y = (size_px.y + part_side_px - 1) / part_side_px;

  [[nodiscard]] std::size_t point(int x, int y) const {
    return static_cast<std::size_t>((y / parts_across * shape_.tiles_x + x / parts_across) *
                                        parts_per_tile +
                                    y % parts_across * parts_across + x % parts_across);
  }

  /// The limits by parts, and the smallest and the largest of each tile.
  std::vector<float> limits(const std::vector<float>& ends, const Pose& now, const Pose& last,
                            int radius, std::vector<float2>& of_tiles) const {
    const std::size_t parts = std::size_t{shape_.tiles()} * parts_per_tile;
    const auto camera = [](const Pose& pose) {
      return make_camera_pair(make_camera(pose, size_px, 150.0f)).single;
    };
    const auto last_ends = upload(ends);
    const auto part = upload(std::vector<float>(parts, -1.0f));
    const auto tile = upload(std::vector<float2>(shape_.tiles(), make_float2(-1.0f, -1.0f)));
    const Stream stream;
    launch_occlusion({.shape = shape_,
                      .now = camera(now),
                      .end = camera(now),
                      .sweeps = false,
                      .shown = make_int4(0, 0, size_px.x, size_px.y),
                      .last = {.camera = camera(last), .shape = shape_},
                      .radius = radius,
                      .last_ends = last_ends.get(),
                      .part = part.get(),
                      .tile = tile.get()},
                     stream.get());
    of_tiles = fetch(tile.get(), shape_.tiles());
    return fetch(part.get(), parts);
  }

  /// Ends of one depth everywhere.
  [[nodiscard]] std::vector<float> even(float depth) const {
    return std::vector<float>(std::size_t{shape_.tiles()} * parts_per_tile, depth);
  }

  FrameShape shape_;
};

TEST_F(OcclusionStage, AStillCameraKeepsTheDeepestEndAround) {
  std::vector<float> ends = even(4.0f);
  std::vector<float2> of_tiles;
  ends[point(7, 5)] = 9.0f;
  ends[point(20, 12)] = unknown;
  const std::vector<float> found = limits(ends, Pose{}, Pose{}, 1, of_tiles);
  Difference limit("occlusion: limits of a still camera, world units", 1e-4);
  for (int y = 0; y < parts_y; ++y) {
    for (int x = 0; x < parts_x; ++x) {
      const auto near = [&](int at_x, int at_y) {
        return std::abs(x - at_x) <= 1 && std::abs(y - at_y) <= 1;
      };
      const float at = found[point(x, y)];
      if (near(20, 12)) {
        EXPECT_EQ(at, unknown);
      } else {
        limit.add(at - 1.02f * (near(7, 5) ? 9.0f : 4.0f));
      }
    }
  }
  for (std::uint32_t t = 0; t < shape_.tiles(); ++t) {
    const auto of_tile = std::span(found).subspan(t * parts_per_tile, parts_per_tile);
    EXPECT_EQ(of_tiles[t].x, std::ranges::min(of_tile)) << t;
    EXPECT_EQ(of_tiles[t].y, std::ranges::max(of_tile)) << t;
  }
}

// A wall at right angles to the last camera's axis, seen from other places.
TEST_F(OcclusionStage, LimitsAreNeverBeforeTheSurfaceTheyComeFrom) {
  constexpr double depth = 5.0;
  for (const catgs::test::Move& move : catgs::test::moves()) {
    SCOPED_TRACE(move.name);
    const Pose last{}, now = catgs::test::moved(last, move);
    std::vector<float2> of_tiles;
    const std::vector<float> found =
        limits(even(static_cast<float>(depth)), now, last, 1, of_tiles);
    std::size_t known = 0;
    for (int y = 0; y < parts_y; ++y) {
      for (int x = 0; x < parts_x; ++x) {
        const float limit = found[point(x, y)];
        if (std::isinf(limit)) continue;
        ++known;
        const glm::dvec3 ray(((x + 0.5) * part_side_px - 0.5 * size_px.x) / 150.0,
                             ((y + 0.5) * part_side_px - 0.5 * size_px.y) / 150.0, 1.0);
        const glm::dvec3 direction = glm::dquat(now.orientation) * ray;
        // Where the ray meets the wall z = depth.
        const double wall = (depth - now.position.z) / direction.z;
        EXPECT_GE(limit, wall);
        EXPECT_LE(limit, 1.03 * wall);
      }
    }
    EXPECT_GT(known, static_cast<std::size_t>(parts_x * parts_y / 2));
  }
}

TEST_F(OcclusionStage, PartsOutsideTheLastPictureAreNotLimited) {
  const Pose last{};
  const Pose now = catgs::test::moved(last, {"yaw", {0, 0, 0}, {0, 0.4f, 0}});
  std::vector<float2> of_tiles;
  const std::vector<float> found = limits(even(5.0f), now, last, 1, of_tiles);
  for (int y = 0; y < parts_y; ++y) {
    EXPECT_EQ(found[point(parts_x - 1, y)], unknown);  // at the side that the camera turns to
    EXPECT_LT(found[point(2, y)], unknown);
  }
  const Pose behind = catgs::test::moved(last, {"about", {0, 0, 0}, {0, 3.14f, 0}});
  for (int y = 0; y < parts_y; ++y)
    for (int x = 0; x < parts_x; ++x)
      EXPECT_EQ(limits(even(5.0f), behind, last, 1, of_tiles)[point(x, y)], unknown);
}

}  // namespace
}  // namespace catgs::cuda::stages
