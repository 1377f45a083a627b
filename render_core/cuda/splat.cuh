#pragma once

#include "render_core/cuda/gaussian.cuh"
#include "render_core/cuda/tiles.cuh"
#include "render_core/math/sweep-inl.h"

namespace catgs::cuda {

/// A camera as kernels use it. Every core evaluates view depth in double.
struct CameraPair {
  math::CameraModel<float> single;
  math::CameraModel<double> precise;
};

inline CameraPair make_camera_pair(const Camera& camera) {
  const auto precise = math::make_camera_model(camera);
  return {math::convert<float>(precise), precise};
}

/// The camera whose picture has its corner at `corner_px` of what it draws, instead of at 0.
inline CameraPair in_grid(CameraPair camera, glm::ivec2 corner_px) {
  const auto move = [&](auto& model) {
    model.principal_point_px.x += static_cast<float>(corner_px.x);
    model.principal_point_px.y += static_cast<float>(corner_px.y);
  };
  move(camera.single);
  move(camera.precise);
  return camera;
}

/// The camera of a frame. For listing also the camera at the end of its window (the same if it has
/// none). They draw into the frame's grid.
struct FrameCameras {
  CameraPair now;  // its near_z is the near plane of the lists
  math::CameraModel<float> end;
  float near_z;  // near plane of the picture
};

/// Base-2 logarithm of an opacity that reaches nothing.
constexpr float never = -1e30f;

/// A Gaussian in the image plane, before its colour.
struct Splat {
  float2 centre_px = {0.0f, 0.0f};
  float2 low_px = {0.0f, 0.0f}, high_px = {0.0f, 0.0f};  // box around it or its path, if in view
  float half_side_px = 0.0f;                             // of the square around it, if in view
  math::Whitening<float> whitening = {1.0f, 0.0f, 1.0f};
  float log2_opacity = never;
  float depth = 0.0f;
  SplatPath path = {0.0f, 0.0f, {1.0f, 0.0f, 1.0f}, never, 0.0f, 0.0f};
  bool in_view = false;  // the box meets the grid
};

/// With `sweeps`, finds splats that are in view at some time of the window; otherwise those in view
/// now.
template <bool sweeps>
__device__ Splat make_splat(const SceneArrays& scene, const FrameCameras& camera,
                            const FrameShape& shape, std::uint32_t i, const Centre& centre) {
  Splat out;
  const math::CameraModel<float>& now = camera.now.single;
  const math::Vec3<float>& mean = centre.mean;
  out.depth = static_cast<float>(math::view_depth(camera.now.precise, math::convert<double>(mean)));
  float reach = math::reach_of(centre.log2_opacity);
  const bool in_front = out.depth > camera.near_z;
  const float end_depth = sweeps ? math::view_depth(camera.end, mean) : out.depth;
  if (reach < 0.0f || fmaxf(out.depth, end_depth) <= now.near_z || !math::is_kept(now, mean))
    return out;

  const math::CovarianceFactor<float> factor = load_factor(scene, i);
  math::Sweep<float> s{};
  math::Vec2<float> half;
  float log2_opacity = centre.log2_opacity;
  if (sweeps) {
    // The footprint changes on its path; that with all of the opacity holds it.
    s = math::sweep(now, camera.end, mean, factor, out.depth);
    if (scene.antialiased) log2_opacity = math::antialiased_log2_opacity(log2_opacity, s.shape);
    half = math::half_extent(s.outline, reach);
  } else {
    s.shape = math::project(now, mean, factor, out.depth);
    if (scene.antialiased) {
      log2_opacity = math::antialiased_log2_opacity(log2_opacity, s.shape);
      reach = math::reach_of(log2_opacity);
      if (reach < 0.0f) return out;
    }
    half = math::half_extent(s.shape, reach);
  }
  const float step_x = 0.5f * s.displacement.x, step_y = 0.5f * s.displacement.y;
  const float x = s.shape.centre_px.x + step_x, y = s.shape.centre_px.y + step_y;
  const float wide = half.x + fabsf(step_x), high = half.y + fabsf(step_y);
  if (x + wide < 0.0f || y + high < 0.0f || x - wide > static_cast<float>(shape.grid_width_px) ||
      y - high > static_cast<float>(shape.grid_height_px)) {
    return out;
  }
  out.in_view = true;
  out.centre_px = make_float2(s.shape.centre_px.x, s.shape.centre_px.y);
  out.low_px = make_float2(x - wide, y - high);
  out.high_px = make_float2(x + wide, y + high);
  out.half_side_px = fmaxf(half.x, half.y);
  out.whitening = math::whitening(s.shape);
  if (in_front) out.log2_opacity = log2_opacity;
  out.path = {s.displacement.x,    s.displacement.y,    s.outline,
              centre.log2_opacity, s.shape.centre_px.x, s.shape.centre_px.y};
  return out;
}

}  // namespace catgs::cuda
