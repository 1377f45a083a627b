#pragma once

#include <optional>

#include "render_core/math/camera.h"

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
  // A sub-frame is drawn only while its Gaussians lie this close to their trails. Farther off, the
  // lists miss some at the edges of tiles. Worst 16x16 blocks of sub-frames against exact, recorded
  // head motion in a captured room: 2 px 51 dB, 3 px 35 dB, 4 px 20 dB.
  float max_deviation_px = 3.0f;
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

/// The largest displacement of a point's image, in pixels, when the camera goes from `now` to
/// `end`. It is taken over a grid of image points of `now`, at `nearest_depth` (world units along
/// the view axis) and at infinity. Depths between the two move less. Infinite when a point at
/// nearest_depth ends up behind the near plane, because no displacement bounds its trail.
float max_displacement_px(const Camera& now, const Pose& end, float nearest_depth);

/// The largest distance of a point's image from its trail, in pixels, when the camera should have
/// gone from `key` to `end` but is at `now`. Takes the points of max_displacement_px(). The lists
/// cover the whole trail, so being early or late on the path is no deviation.
float max_deviation_px(const Camera& key, const Pose& end, const Pose& now, float nearest_depth);

/// The paper's rule, with M the displacement over `initial_window` frames: W0 if M <= l, else
/// floor(W0 l / M).
int speculation_window(int initial_window, float max_trail_px, float displacement_px);

struct FramePlan {
  FrameKind kind = FrameKind::key;
  int window = 0;     // sub-frames promised after the group's key frame; 0: no speculation
  Camera window_end;  // what the group's lists reach to: the camera after `window` frames
};

/// Groups the frames of one View.
class FrameGroups {
 public:
  /// Throws as check_speculation().
  explicit FrameGroups(const SpeculationSettings& settings);

  /// Decides whether the frame is a key frame or a sub-frame, and counts it as drawn.
  /// `nearest_depth` is FrameStats::nearest_depth of the last frame, or 0. A depth that is too
  /// small or not finite means speculation_min_depth(). Without a forecast the frame is a key frame
  /// without a window.
  FramePlan plan(const Camera& now, const std::optional<Forecast>& forecast, float nearest_depth);

  /// Ends the group because its caches are gone. The next frame is a key frame.
  void forget() { group_.window = 0; }

 private:
  [[nodiscard]] bool continues(const Camera& now, float nearest_depth) const;
  void begin_group(const Camera& now, const Forecast& forecast, float nearest_depth);

  SpeculationSettings settings_;
  Camera key_;       // of the group's key frame
  FramePlan group_;  // of the group's key frame
  int drawn_ = 0;    // sub-frames of the group so far
};

}  // namespace catgs
