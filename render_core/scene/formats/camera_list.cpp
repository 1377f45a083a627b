#include "render_core/scene/formats/camera_list.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <nlohmann/json.hpp>

#include "render_core/scene/formats/json_field.h"

namespace catgs {
namespace {

constexpr std::uint64_t max_cameras_bytes = 16 << 20;  // 10,000 cameras take 5 MiB

/// The orientation of a rotation matrix that `field` stores.
glm::quat orientation_of(const JsonField& field, const glm::mat3& rotation) {
  // A determinant of 1 alone is not enough: a shear can have it, with numbers of any size.
  bool is_rotation = std::abs(glm::determinant(rotation) - 1.0f) < 0.05f;
  for (int c = 0; c < 3; ++c)
    is_rotation = is_rotation && std::abs(glm::length(rotation[c]) - 1.0f) < 0.05f;
  if (!is_rotation) field.fail("is not a rotation");
  return glm::normalize(glm::quat_cast(rotation));
}

/// A 3DGS training's camera: position, and a 3x3 matrix from our camera axes.
Pose training_pose(const JsonField& camera, const glm::dvec3& origin) {
  const glm::vec3 position = camera.at("position").place(origin);
  const JsonField rows = camera.at("rotation");
  if (rows.size() != 3) rows.fail("is not a 3x3 matrix");
  glm::mat3 rotation;
  for (int r = 0; r < 3; ++r) {
    const std::vector<float> row = rows[static_cast<std::size_t>(r)].numbers(3);
    for (int c = 0; c < 3; ++c) rotation[c][r] = row[static_cast<std::size_t>(c)];
  }
  return {position, orientation_of(rows, rotation)};
}

/// A world-from-camera matrix of OpenGL axes (y up, z back): 3 or 4 rows, or 16 numbers by rows.
Pose opengl_pose(const JsonField& matrix, const glm::dvec3& origin) {
  std::vector<double> m;
  if (matrix.size() == 16) {
    const auto numbers = matrix.doubles<16>();
    m.assign(numbers.begin(), numbers.end());
  } else {
    if (matrix.size() != 3 && matrix.size() != 4) matrix.fail("is not a 4x4 matrix");
    for (std::size_t r = 0; r < 3; ++r) {
      const auto row = matrix[r].doubles<4>();
      m.insert(m.end(), row.begin(), row.end());
    }
  }
  glm::dmat3 rotation;
  glm::dvec3 position;
  for (int r = 0; r < 3; ++r) {
    const double* row = m.data() + static_cast<std::size_t>(r) * 4;
    for (int c = 0; c < 3; ++c) rotation[c][r] = c == 0 ? row[c] : -row[c];
    position[r] = row[3];
  }
  return {matrix.as_place(position, origin), orientation_of(matrix, glm::mat3(rotation))};
}

/// A positive number of a camera, or of all cameras of the file; 0 where there is none.
float positive(const JsonField& camera, const JsonField& file, std::string_view key) {
  for (const JsonField* field : {&camera, &file}) {
    if (!field->value().is_object()) continue;
    const auto found = field->find(key);
    if (found && found->value().is_number()) return std::max(found->number(), 0.0f);
  }
  return 0.0f;
}

/// Sets the lens, if all of it is known. Without a principal point it is the middle.
void set_lens(glm::vec2 size_px, glm::vec2 focal_px, glm::vec2 principal_point_px, Camera& camera) {
  constexpr float max_side_px = 1 << 20;
  if (focal_px.y == 0.0f) focal_px.y = focal_px.x;
  if (!(std::min(size_px.x, size_px.y) >= 1.0f && std::max(size_px.x, size_px.y) <= max_side_px &&
        focal_px.x > 0.0f))
    return;
  camera.size_px = glm::ivec2(size_px);
  camera.focal_px = focal_px;
  camera.principal_point_px = glm::vec2(camera.size_px) * 0.5f;
  for (int axis = 0; axis < 2; ++axis)
    if (principal_point_px[axis] > 0.0f) camera.principal_point_px[axis] = principal_point_px[axis];
}

float focal_from_angle(float angle_rad, float side_px) {
  const bool usable = angle_rad > 0.0f && angle_rad < std::numbers::pi_v<float>;
  return usable ? 0.5f * side_px / std::tan(0.5f * angle_rad) : 0.0f;
}

std::string name_of(const JsonField& camera, std::string_view key) {
  const auto name = camera.find(key);
  return name && name->value().is_string() ? name->text() : std::string();
}

CameraList read_array(const JsonField& all, const glm::dvec3& origin) {
  CameraList list;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const JsonField item = all[i];
    ListedCamera& listed = list.cameras.emplace_back();
    if (const auto matrix = item.find("transform")) {
      listed.name = name_of(item, "file_path");
      listed.camera.world_from_camera = opengl_pose(*matrix, origin);
      continue;
    }
    const auto number = [&](std::string_view key) { return positive(item, item, key); };
    listed.name = name_of(item, "img_name");
    listed.camera.world_from_camera = training_pose(item, origin);
    set_lens({number("width"), number("height")}, {number("fx"), number("fy")}, {}, listed.camera);
  }
  // A training writes its test views first. The names of a video's frames are in order of time.
  if (std::ranges::none_of(list.cameras, &std::string::empty, &ListedCamera::name))
    std::ranges::stable_sort(list.cameras, {}, &ListedCamera::name);
  return list;
}

CameraList read_transforms(const JsonField& file, const glm::dvec3& origin) {
  CameraList list;
  const JsonField frames = file.at("frames");
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const JsonField frame = frames[i];
    const auto number = [&](std::string_view key) { return positive(frame, file, key); };
    ListedCamera& listed = list.cameras.emplace_back();
    listed.name = name_of(frame, "file_path");
    listed.camera.world_from_camera = opengl_pose(frame.at("transform_matrix"), origin);
    const glm::vec2 size_px{number("w"), number("h")};
    glm::vec2 focal_px{number("fl_x"), number("fl_y")};
    if (focal_px.x == 0.0f) focal_px.x = focal_from_angle(number("camera_angle_x"), size_px.x);
    if (focal_px.y == 0.0f) focal_px.y = focal_from_angle(number("camera_angle_y"), size_px.y);
    set_lens(size_px, focal_px, {number("cx"), number("cy")}, listed.camera);
  }
  return list;
}

CameraList read_path(const JsonField& file, const glm::dvec3& origin) {
  if (const auto type = file.find("camera_type"); type && type->text() != "perspective")
    type->fail("is not a perspective camera", "this renderer draws perspective pictures only");
  const auto number = [&](std::string_view key) { return positive(file, file, key); };
  const glm::vec2 size_px{number("render_width"), number("render_height")};
  CameraList list;
  const JsonField cameras = file.at("camera_path");
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const JsonField item = cameras[i];
    ListedCamera& listed = list.cameras.emplace_back();
    listed.camera.world_from_camera = opengl_pose(item.at("camera_to_world"), origin);
    const float fov_y_rad = positive(item, item, "fov") * std::numbers::pi_v<float> / 180.0f;
    set_lens(size_px, glm::vec2(focal_from_angle(fov_y_rad, size_px.y)), {}, listed.camera);
  }
  const auto count = static_cast<float>(list.cameras.size());
  if (number("fps") > 0.0f) {
    list.rate_hz = number("fps");
  } else if (number("seconds") > 0.0f) {
    list.rate_hz = count / number("seconds");
  }
  return list;
}

}  // namespace

CameraList read_camera_json(const ByteSource& file, const glm::dvec3& origin) {
  const nlohmann::json document = read_json(file, max_cameras_bytes);
  const JsonField root(file.name(), document);
  if (document.is_array()) return read_array(root, origin);
  if (root.find("camera_path")) return read_path(root, origin);
  if (root.find("tours"))
    root.fail("is a sidecar, whose tours are not a camera path",
              "with ?author, the page saves the camera path of a tour as a .tum file");
  if (!root.find("frames"))
    root.fail("lists no cameras",
              "cameras.json of a 3DGS training, transforms.json or camera_path.json of nerfstudio");
  return read_transforms(root, origin);
}

}  // namespace catgs
