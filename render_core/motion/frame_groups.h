#pragma once

#include <optional>

#include "render_core/math/camera.h"
#include "render_core/motion/tile_grid.h"

namespace catgs {

// Which frames are key frames: the motion-adaptive window of the paper (3.1.2). A key frame lists
// every Gaussian for all tiles that it will touch while the camera moves as forecast; the
// sub-frames behind it draw from these lists. Pure: both cores ask here, and no other place
// decides.

enum class FrameKind {
  key,  // culls, lists and sorts
  sub,  // projects and shades what its key frame listed, and blends from its lists
};

/// Where the camera is expected to be, made from past poses only: it moves uniformly from the
/// request's pose to `world_from_camera`, where it arrives `frames` frames later.
struct Forecast {
  Pose world_from_camera;
  int frames = 0;
};

struct SpeculationSettings {
  int initial_window = 4;      // W0: sub-frames behind a key frame while motion is small; 0: never
  float max_trail_px = 16.0f;  // l: the window shrinks when a Gaussian would move farther in it
  float min_depth = 0.0f;      // d, world units: nearer ones do not shrink it; 0: 2 x near plane
  GridKind grid = GridKind::warp;
  // GridKind::warp: px by which lists are widened, in the mean over the Gaussians in view, for a
  // camera that leaves its forecast path. Sub-frames end where the camera is farther off than that.
  float guard_px = 0.5f;
  // Other grids: a sub-frame is drawn only while its Gaussians lie this close to their trails;
  // farther off, the lists miss some at the edges of tiles. Worst 16x16 blocks of sub-frames
  // against exact, recorded head motion in a captured room: 2 px 51 dB, 3 px 35 dB, 4 px 20 dB.
  float max_deviation_px = 3.0f;
  // Views stop speculating for a while where groups cost more than frames without a window; see
  // SpeculationCosts. Off, which frames are key frames does not depend on time.
  bool cost_aware = false;
};

/// Bounds what one forecast may promise, whatever the settings.
inline constexpr int max_initial_window = 64;

/// Throws InputError naming the flag of a setting that is out of range.
void check_speculation(const SpeculationSettings& settings);

/// d of the settings in world units, for a camera with this near plane.
float speculation_min_depth(const SpeculationSettings& settings, float near_z);

/// The pose after `share` (0…1) of a motion at constant velocity and constant angular rate, the
/// short way round.
Pose uniform_motion(const Pose& from, const Pose& to, float share);

/// What a view knows of the depths in its picture, from the last frame that it finished: of visible
/// Gaussians deeper than speculation_min_depth().
struct SceneDepths {
  float nearest = 0.0f;       // world units along the view axis; 0: not known
  float mean_inverse = 0.0f;  // 1 / world units; 0: not known
};

/// How far the image of a point may move, in pixels, when the camera goes from `now` to `end`: the
/// largest displacement over a grid of image points of `now` at `nearest_depth` (world units along
/// the view axis) and at infinity. Depths between the two move less. Infinite when a point at
/// nearest_depth ends up behind the near plane: no displacement bounds its trail.
/// `end_shift_px` is added.
float max_displacement_px(const Camera& now, const Pose& end, float nearest_depth,
                          glm::ivec2 end_shift_px = glm::ivec2(0));

/// How far from its trail the image of a point may lie, in pixels, when the camera should have gone
/// from `key` to `end` but is at `now`; over the points of max_displacement_px(). The trail is what
/// lists cover, so being early or late on the path is no deviation. The pictures from `end` and
/// `now` are moved by these shifts before they are compared.
float max_deviation_px(const Camera& key, const Pose& end, const Pose& now, float nearest_depth,
                       glm::ivec2 end_shift_px = glm::ivec2(0),
                       glm::ivec2 now_shift_px = glm::ivec2(0));

/// The paper's rule, with M the displacement over `initial_window` frames: W0 if M <= l, else
/// floor(W0 l / M).
int speculation_window(int initial_window, float max_trail_px, float displacement_px);

struct FramePlan {
  FrameKind kind = FrameKind::key;
  int window = 0;     // sub-frames promised behind the group's key frame; 0: no speculation
  Camera window_end;  // where the group's lists reach: the camera after `window` frames, or with
                      // GridKind::warp the key frame's orientation there
  TileGrid grid;      // of the group's lists, in the key frame's image plane
  glm::ivec2 trail_shift_px{0};  // GridKind::shift at the window's end: added to all trails
  ListGrowth<double> growth{};   // of the group's lists
  float list_near_z = 0.0f;      // they hold Gaussians beyond this view depth
  // Sub-frames: pixel p of the picture has the lists of the tile that holds list_from_frame(p);
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

  /// Key or sub-frame? Counts the frame as drawn. Depths that are too small, or no numbers, mean
  /// speculation_min_depth(). Without a forecast the frame is a key frame and gets no window.
  FramePlan plan(const Camera& now, const std::optional<Forecast>& forecast,
                 const SceneDepths& depths);

  /// The group ends, its caches gone or not enough: the next frame is a key frame.
  void forget() { group_.window = 0; }

 private:
  [[nodiscard]] bool continues(const Camera& now, const SceneDepths& depths) const;
  [[nodiscard]] FramePlan sub_frame(const Camera& now) const;
  void begin_group(const Camera& now, const Forecast& forecast, const SceneDepths& depths);

  SpeculationSettings settings_;
  Camera key_;       // of the group
  FramePlan group_;  // of its key frame
  GuardSet guard_;
  int drawn_ = 0;  // sub-frames of the group so far
};

}  // namespace catgs
