#pragma once

#include <optional>

#include "render_core/camera.h"

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
  // A sub-frame is drawn only while its Gaussians lie this close to their trails; farther off, the
  // lists miss some at the edges of tiles. Worst 16x16 blocks of sub-frames against exact, recorded
  // head motion in a captured room: 2 px 51 dB, 3 px 35 dB, 4 px 20 dB.
  float max_deviation_px = 3.0f;
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

/// How far the image of a point may move, in pixels, when the camera goes from `now` to `end`: the
/// largest displacement over a grid of image points of `now` at `nearest_depth` (world units along
/// the view axis) and at infinity. Depths between the two move less. Infinite when a point at
/// nearest_depth ends up behind the near plane: no displacement bounds its trail.
float max_displacement_px(const Camera& now, const Pose& end, float nearest_depth);

/// How far from its trail the image of a point may lie, in pixels, when the camera should have gone
/// from `key` to `end` but is at `now`; over the points of max_displacement_px(). The trail is what
/// lists cover, so being early or late on the path is no deviation.
float max_deviation_px(const Camera& key, const Pose& end, const Pose& now, float nearest_depth);

/// The paper's rule, with M the displacement over `initial_window` frames: W0 if M <= l, else
/// floor(W0 l / M).
int speculation_window(int initial_window, float max_trail_px, float displacement_px);

struct FramePlan {
  FrameKind kind = FrameKind::key;
  int window = 0;     // sub-frames promised behind the group's key frame; 0: no speculation
  Camera window_end;  // where the group's lists reach: the camera after `window` frames
};

/// Groups the frames of one View.
class FrameGroups {
 public:
  /// Throws as check_speculation().
  explicit FrameGroups(const SpeculationSettings& settings);

  /// Key or sub-frame? Counts the frame as drawn. `nearest_depth`: of visible Gaussians deeper than
  /// speculation_min_depth() in the last frame that the view finished; anything less, or NaN, means
  /// that depth itself. Without a forecast the frame is a key
  /// frame and gets no window.
  FramePlan plan(const Camera& now, const std::optional<Forecast>& forecast, float nearest_depth);

  /// The caches are gone (a failed frame): the next frame is a key frame.
  void forget() { window_ = 0; }

 private:
  [[nodiscard]] bool continues(const Camera& now, float nearest_depth) const;

  SpeculationSettings settings_;
  Camera key_, end_;  // of the group
  int window_ = 0;
  int drawn_ = 0;  // sub-frames of the group so far
};

}  // namespace catgs
