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

std::string find_mistake(const FrameRequest& request, PixelFormat format) {
  const Camera& camera = request.camera;
  const glm::ivec2 size = camera.size_px;
  if (size.x < 1 || size.y < 1 || size.x > max_image_side_px || size.y > max_image_side_px)
    return "image size " + std::to_string(size.x) + "x" + std::to_string(size.y) +
           " is outside 1x1…" + std::to_string(max_image_side_px) + " a side";
  if (format == PixelFormat::i420 && (size.x % 2 != 0 || size.y % 2 != 0))
    return "i420 needs even sides, not " + std::to_string(size.x) + "x" + std::to_string(size.y);
  const glm::vec2 focal = camera.focal_px;
  if (!(focal.x > 0 && focal.y > 0 && std::isfinite(focal.x) && std::isfinite(focal.y)))
    return "focal length must be positive";
  const glm::vec2 centre = camera.principal_point_px;
  if (!std::isfinite(centre.x) || !std::isfinite(centre.y)) return "principal point is not finite";
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
    return "depth grid " + std::to_string(cells.x) + "x" + std::to_string(cells.y) +
           " is outside 1x1…" + std::to_string(max_depth_cells) + " a side";
  std::string mistake = find_mistake(camera.world_from_camera, "camera");
  if (mistake.empty() && request.forecast) {
    mistake = find_mistake(request.forecast->world_from_camera, "forecast");
  }
  return mistake;
}

}  // namespace

RenderStatus check_request(const FrameRequest& request, PixelFormat format) {
  std::string mistake = find_mistake(request, format);
  if (mistake.empty()) return {};
  return {RenderStatus::Code::invalid_request, "request: " + mistake};
}

}  // namespace catgs
