#pragma once

#include <optional>

#include <glm/vec2.hpp>

#include "render_core/math/camera.h"

namespace catgs {

// The choice of key frames: the motion-adaptive window of the paper (3.1.2). A key frame lists
// every Gaussian for all tiles that it will touch while the camera moves as forecast. The
// sub-frames after it draw from these lists. Pure: both cores ask here, and nothing else decides.
//
// The paper's tiles stay where they are in the picture. On a grid that follows the camera, what
// lies ahead stays in its tile, whatever the camera turns and however it really turns. Only
// parallax and the bend of the picture's edges then move Gaussians against their lists.

enum class FrameKind {
  key,  // culls, lists and sorts
  sub,  // projects and shades the Gaussians of its key frame's lists, and blends from these lists
};

/// The expected motion of the camera, predicted from past poses only. It moves uniformly from the
/// request's pose to `world_from_camera`, and arrives there `frames` frames later.
struct Forecast {
  Pose world_from_camera;
  int frames = 0;
};

struct SpeculationSettings {
  int initial_window = 4;      // W0: sub-frames after a key frame while motion is small; 0: never
  float max_trail_px = 16.0f;  // l: the window shrinks when a Gaussian would move farther in it
  float min_depth = 0.0f;      // d, world units: nearer ones do not shrink it; 0: 2 x near plane
  // A sub-frame is drawn only while its Gaussians lie this close to their trails. Farther off, the
  // lists miss some at the edges of tiles. Worst 16x16 blocks of sub-frames against exact, recorded
  // head motion in a captured room: 2 px 51 dB, 3 px 35 dB, 4 px 20 dB.
  float max_deviation_px = 3.0f;
  // A View of Pipeline::catgs has windows only where they save time: see WindowGain.
  bool where_it_pays = true;
};

/// For a grid that follows the camera.
inline constexpr SpeculationSettings following_speculation{.initial_window = 12,
                                                           .max_deviation_px = 2.5f};

/// The largest window that one forecast may promise, whatever the settings.
inline constexpr int max_initial_window = 64;

/// Throws InputError naming the flag of a setting that is out of range.
void check_speculation(const SpeculationSettings& settings);

/// d of the settings in world units, for a camera with this near plane.
float speculation_min_depth(const SpeculationSettings& settings, float near_z);

/// The pose after `share` (0…1) of a motion at constant velocity and constant angular rate, the
/// short way round.
Pose uniform_motion(const Pose& from, const Pose& to, float share);

/// The largest displacement of a point's image, in pixels, when the camera goes from `now` to
/// `end`, against tiles that move by `end_shift_px` meanwhile. It is taken over a grid of image
/// points of `now`, at `nearest_depth` (world units along the view axis) and at infinity. Depths
/// between the two move less. Infinite when a point at nearest_depth ends up behind the near plane,
/// because no displacement bounds its trail.
float max_displacement_px(const Camera& now, const Pose& end, float nearest_depth,
                          glm::ivec2 end_shift_px = {});

/// The largest distance of a point's image from its trail, in pixels, when the camera should have
/// gone from `key` to `end` but is at `now`, against tiles that move by `end_shift_px` and have
/// moved by `shift_px`. Takes the points of max_displacement_px(). The lists cover the whole trail,
/// so being early or late on the path is no deviation.
float max_deviation_px(const Camera& key, const Pose& end, const Pose& now, float nearest_depth,
                       glm::ivec2 end_shift_px = {}, glm::ivec2 shift_px = {});

/// The paper's rule, with M the displacement over `initial_window` frames: W0 if M <= l, else
/// floor(W0 l / M).
int speculation_window(int initial_window, float max_trail_px, float displacement_px);

/// How far what `key` shows in its middle, at view depth `depth` (world units; may be infinite),
/// has moved in the picture from pose `now`, in whole pixels. Far beyond any picture if it is
/// behind that camera.
glm::ivec2 middle_shift_px(const Camera& key, const Pose& now, float depth);

enum class TileGrid {
  fixed,    // to the picture: the paper's
  follows,  // the middle of the picture
};

/// Beyond the pictures of its window, a grid that follows covers this much on each side.
inline constexpr int grid_margin_px = 16;
/// A sub-frame may turn so much farther than forecast. The rest of the margin is for what deviates
/// at the picture's edge.
inline constexpr int most_extra_turn_px = 8;
/// A grid that follows is at most so much larger than its picture, without the margins.
inline constexpr int most_travel_px = 96;

struct FramePlan {
  FrameKind kind = FrameKind::key;
  int window = 0;     // sub-frames promised after the group's key frame; 0: no speculation
  Camera window_end;  // what the group's lists reach to: the camera after `window` frames
  // TileGrid::follows: how far the group's grid has moved in the picture since the key frame, and
  // how far it will have at window_end.
  glm::ivec2 shift_px{0}, end_shift_px{0};
};

/// Groups the frames of one View.
class FrameGroups {
 public:
  /// Throws as check_speculation().
  explicit FrameGroups(const SpeculationSettings& settings, TileGrid grid = TileGrid::fixed);

  /// Decides whether the frame is a key frame or a sub-frame, and counts it as drawn. `depth`,
  /// world units: with a fixed grid the nearest that counts, FrameStats::nearest_depth of the last
  /// frame; with one that follows a typical one, the inverse of its mean_inverse_depth. A depth
  /// that is too small or not finite means speculation_min_depth(). Without a forecast the frame is
  /// a key frame without a window.
  FramePlan plan(const Camera& now, const std::optional<Forecast>& forecast, float depth);

  /// Ends the group because its caches are gone. The next frame is a key frame.
  void forget() { group_.window = 0; }

 private:
  [[nodiscard]] bool continues(const Camera& now, float depth);
  void begin_group(const Camera& now, const Forecast& forecast, float depth);

  SpeculationSettings settings_;
  TileGrid grid_;
  Camera key_;       // of the group's key frame
  float depth_ = 0;  // that it was planned with
  FramePlan group_;  // of the group's key frame
  int drawn_ = 0;    // sub-frames of the group so far
};

}  // namespace catgs
