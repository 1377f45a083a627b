#pragma once

#include <optional>

#include "render_core/math/camera.h"
#include "render_core/motion/tile_grid.h"

namespace catgs {

// The choice of key frames: the motion-adaptive window of the paper (3.1.2). A key frame lists
// every Gaussian for all tiles that it will touch while the camera moves as forecast. The
// sub-frames after it draw from these lists. Pure: both cores ask here, and nothing else decides.

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
  GridKind grid = GridKind::warp;
  // GridKind::warp: px by which lists are widened for a camera that leaves its forecast path, as a
  // mean over the Gaussians in view. Sub-frames end where the camera is farther off.
  float guard_px = 0.5f;
  // Other grids: a sub-frame is drawn only while its Gaussians lie this close to their trails.
  // Farther off, the lists miss some at the edges of tiles. Worst 16x16 blocks of sub-frames
  // against exact, recorded head motion in a captured room: 2 px 51 dB, 3 px 35 dB, 4 px 20 dB.
  float max_deviation_px = 3.0f;
  // Views stop speculating for a while where groups cost more than frames without a window; see
  // SpeculationCosts. Without it, the choice of key frames does not depend on time.
  bool cost_aware = false;
};

/// The largest window that one forecast may promise, whatever the settings.
inline constexpr int max_initial_window = 64;

/// Throws InputError naming the flag of a setting that is out of range.
void check_speculation(const SpeculationSettings& settings);

/// d of the settings in world units, for a camera with this near plane.
float speculation_min_depth(const SpeculationSettings& settings, float near_z);

/// The pose after `share` (0…1) of a motion at constant velocity and constant angular rate, the
/// short way round.
Pose uniform_motion(const Pose& from, const Pose& to, float share);

/// The depths in a view's picture, from the last frame that it finished. Over visible Gaussians
/// deeper than speculation_min_depth().
struct SceneDepths {
  float nearest = 0.0f;       // world units along the view axis; 0: not known
  float mean_inverse = 0.0f;  // 1 / world units; 0: not known
};

/// The largest displacement of a point's image, in pixels, when the camera goes from `now` to
/// `end`. It is taken over a grid of image points of `now`, at `nearest_depth` (world units along
/// the view axis) and at infinity. Depths between the two move less. Infinite when a point at
/// nearest_depth ends up behind the near plane, because no displacement bounds its trail.
/// `end_shift_px` is added.
float max_displacement_px(const Camera& now, const Pose& end, float nearest_depth,
                          glm::ivec2 end_shift_px = glm::ivec2(0));

/// The largest distance of a point's image from its trail, in pixels, when the camera should have
/// gone from `key` to `end` but is at `now`. Takes the points of max_displacement_px(). The lists
/// cover the whole trail, so being early or late on the path is no deviation. The pictures from
/// `end` and `now` are moved by these shifts before they are compared.
float max_deviation_px(const Camera& key, const Pose& end, const Pose& now, float nearest_depth,
                       glm::ivec2 end_shift_px = glm::ivec2(0),
                       glm::ivec2 now_shift_px = glm::ivec2(0));

/// The paper's rule, with M the displacement over `initial_window` frames: W0 if M <= l, else
/// floor(W0 l / M).
int speculation_window(int initial_window, float max_trail_px, float displacement_px);

struct FramePlan {
  FrameKind kind = FrameKind::key;
  int window = 0;     // sub-frames promised after the group's key frame; 0: no speculation
  Camera window_end;  // the pose that the group's lists reach to: the camera after `window` frames;
                      // with GridKind::warp its orientation is that of the key frame
  TileGrid grid;      // of the group's lists, in the key frame's image plane
  glm::ivec2 trail_shift_px{0};  // GridKind::shift: added to all trails, at the window's end
  ListGrowth<double> growth{};   // of the group's lists
  float list_near_z = 0.0f;      // they hold the Gaussians beyond this view depth
  // Sub-frames: pixel p of the picture uses the lists of the tile that holds list_from_frame(p);
  // without GridKind::warp that is p + shift_px.
  Homography<double> list_from_frame{};
  glm::ivec2 shift_px{0};
  bool warped = false;
};

/// Groups the frames of one View.
class FrameGroups {
 public:
  /// Throws as check_speculation().
  explicit FrameGroups(const SpeculationSettings& settings);

  /// Decides whether the frame is a key frame or a sub-frame, and counts it as drawn. Depths that
  /// are too small or not finite mean speculation_min_depth(). Without a forecast the frame is a
  /// key frame without a window.
  FramePlan plan(const Camera& now, const std::optional<Forecast>& forecast,
                 const SceneDepths& depths);

  /// Ends the group because its caches are gone or not enough. The next frame is a key frame.
  void forget() { group_.window = 0; }

 private:
  [[nodiscard]] bool continues(const Camera& now, const SceneDepths& depths) const;
  [[nodiscard]] FramePlan sub_frame(const Camera& now) const;
  void begin_group(const Camera& now, const Forecast& forecast, const SceneDepths& depths);

  SpeculationSettings settings_;
  Camera key_;       // of the group's key frame
  FramePlan group_;  // of the group's key frame
  GuardSet guard_;
  int drawn_ = 0;  // sub-frames of the group so far
};

}  // namespace catgs
