#include "render_core/frame/renderer.h"

#include <cmath>

#include <glm/vector_relational.hpp>

namespace catgs {
namespace {

bool finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

std::string find_mistake(const Pose& pose, const std::string& name) {
  if (!finite(pose.position)) return name + " position is not finite";
  const float norm = glm::length(pose.orientation);
  if (!(norm > 1e-6f && std::isfinite(norm))) return name + " orientation is not a rotation";
  return {};
}

std::string text_of(glm::ivec2 size) {
  return std::to_string(size.x) + "x" + std::to_string(size.y);
}

std::string find_mistake_in_lens(const Camera& camera) {
  const glm::vec2 focal = camera.focal_px;
  if (!(focal.x > 0 && focal.y > 0 && std::isfinite(focal.x) && std::isfinite(focal.y)))
    return "focal length must be positive";
  const glm::vec2 centre = camera.principal_point_px;
  if (!std::isfinite(centre.x) || !std::isfinite(centre.y)) return "principal point is not finite";
  return {};
}

std::string find_mistake_in_eyes(const FrameRequest& request) {
  const Camera& head = request.camera;
  if (head.orthographic) return "two eyes have no orthographic picture";
  if (head.crop != Crop{}) return "pictures of two eyes have no parts";
  if (head.size_px.x % 2 != 0)
    return "an image of two eyes has an even width, not " + std::to_string(head.size_px.x);
  if (request.depth_cells.x % 2 != 0)
    return "a depth grid of two eyes has even columns, not " +
           std::to_string(request.depth_cells.x);
  static_assert(max_eye_tangent == 10.0f, "the text below says so");
  const Stereo& eyes = *request.stereo;
  for (std::size_t i = 0; i < eyes.size(); ++i)
    if (!is_valid(eyes[i]))
      return std::string(i == 0 ? "left" : "right") +
             " eye: its offset is too large, or its tangents are not left < right and up < down in "
             "-10…10";
  return {};
}

std::string find_mistake(const FrameRequest& request, PixelFormat format) {
  const Camera& camera = request.camera;
  const glm::ivec2 size = camera.size_px;
  if (size.x < 1 || size.y < 1 || size.x > max_image_side_px || size.y > max_image_side_px)
    return "image size " + text_of(size) + " is outside 1x1…" + std::to_string(max_image_side_px) +
           " a side";
  if (std::string bad =
          request.stereo ? find_mistake_in_eyes(request) : find_mistake_in_lens(camera);
      !bad.empty())
    return bad;
  const glm::ivec2 eye_size = request.stereo ? size / glm::ivec2(2, 1) : size;
  if (format == PixelFormat::i420 && (eye_size.x % 2 != 0 || eye_size.y % 2 != 0))
    return "i420 needs even sides, not " + text_of(eye_size) + (request.stereo ? " an eye" : "");
  if (!(camera.near_z > 0 && std::isfinite(camera.near_z))) return "near plane must be positive";
  const ClipBox& clip = camera.clip;
  for (int i = 0; i < 3; ++i)
    if (!finite(clip.axes[i]) || !(clip.low[i] <= clip.high[i]))
      return "clip box is not finite, or empty";
  const Crop& crop = camera.crop;
  if (crop != Crop{} && (glm::any(glm::lessThan(crop.from_px, glm::ivec2(0))) ||
                         glm::any(glm::greaterThan(crop.from_px + size, crop.whole_px))))
    return "the part does not lie in the whole picture";
  if (!finite(request.background)) return "background is not finite";
  const glm::ivec2 cells = request.depth_cells;
  if (cells != glm::ivec2(0) &&
      (cells.x < 1 || cells.y < 1 || cells.x > max_depth_cells || cells.y > max_depth_cells))
    return "depth grid " + text_of(cells) + " is outside 1x1…" + std::to_string(max_depth_cells) +
           " a side";
  std::string mistake = find_mistake(camera.world_from_camera, "camera");
  if (mistake.empty() && request.forecast) {
    mistake = find_mistake(request.forecast->world_from_camera, "forecast");
  }
  return mistake;
}

}  // namespace

std::vector<Camera> cameras_of(const FrameRequest& request) {
  if (!request.stereo) return {request.camera};
  std::vector<Camera> cameras;
  for (const Eye& eye : *request.stereo) cameras.push_back(eye_camera(request.camera, eye));
  return cameras;
}

RenderStatus check_request(const FrameRequest& request, PixelFormat format) {
  std::string mistake = find_mistake(request, format);
  if (mistake.empty()) return {};
  return {RenderStatus::Code::invalid_request, "request: " + mistake};
}

}  // namespace catgs
