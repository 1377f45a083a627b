#include "render_core/scene/formats/camera_list.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <optional>
#include <string_view>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/printable.h"
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
  const glm::vec3 position = camera.at("position").position(origin);
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
  return {matrix.as_position(position, origin), orientation_of(matrix, glm::mat3(rotation))};
}

/// A field of a camera, or of all cameras of the file, by the first of its names that is there.
std::optional<JsonField> field_of(const JsonField& camera, const JsonField& file,
                                  std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names)
    for (const JsonField* from : {&camera, &file})
      if (from->value().is_object())
        if (auto found = from->find(name)) return found;
  return std::nullopt;
}

/// Numbers of a camera, or of all cameras of the file; 0 where there is none.
struct Numbers {
  const JsonField& camera;
  const JsonField& file;

  [[nodiscard]] double any(std::initializer_list<std::string_view> names) const {
    const auto found = field_of(camera, file, names);
    return found && found->value().is_number() ? found->precise_number() : 0.0;
  }
  [[nodiscard]] double positive(std::initializer_list<std::string_view> names) const {
    return std::max(any(names), 0.0);
  }
};

/// Whether no perspective picture shows what such a lens does.
bool no_pinhole(std::string_view model) {
  static constexpr std::array parts = {"EQUIRECT", "OMNI",      "VR180", "ORTHO",
                                       "PANORAMA", "SPHERICAL", "CYLIND"};
  return std::ranges::any_of(
      parts, [&](const char* part) { return model.find(part) != std::string_view::npos; });
}

/// Whether a lens of this model without further numbers is a pinhole.
bool can_be_straight(std::string_view model) {
  static constexpr std::array<std::string_view, 10> models = {
      "",       "PERSPECTIVE", "PINHOLE",     "SIMPLE_PINHOLE", "SIMPLE_RADIAL",
      "RADIAL", "OPENCV",      "FULL_OPENCV", "BROWN",          "RADTAN"};
  return std::ranges::find(models, model) != models.end();
}

/// The model of a lens in upper case and its numbers; empty for a pinhole.
std::string distortion_of(const JsonField& camera, const JsonField& file) {
  std::string text;
  if (const auto model = field_of(camera, file, {"camera_model", "camera_type"});
      model && model->value().is_string())
    text = printable(model->text().substr(0, 40));
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  for (const std::string_view flag : {"is_fisheye", "fisheye", "latlong", "equirectangular"}) {
    const auto is = field_of(camera, file, {flag});
    if (is && is->value() == true && can_be_straight(text))
      text = flag.ends_with("fisheye") ? "FISHEYE" : "EQUIRECTANGULAR";
  }
  bool straight = can_be_straight(text);
  for (const char* name :
       {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "p3", "p4", "s1", "s2", "s3", "s4",
        "ftheta_p0", "ftheta_p1", "ftheta_p2", "ftheta_p3", "ftheta_p4"}) {
    const double number = Numbers{camera, file}.any({name});
    if (number == 0.0) continue;
    text += fmt::format("{}{} {:g}", text.empty() ? "" : " ", name, number);
    straight = false;
  }
  return straight ? std::string() : text;
}

/// The lens, as far as the file tells it. Focal lengths come before angles.
Lens read_lens(const JsonField& camera, const JsonField& file) {
  constexpr double max_side_px = 1 << 20, least_focal_px = 1e-6;
  constexpr double degree = std::numbers::pi / 180.0;
  const Numbers of{camera, file};
  glm::dvec2 size_px{of.positive({"w", "width", "render_width"}),
                     of.positive({"h", "height", "render_height"})};
  const glm::dvec2 focal_px{of.positive({"fl_x", "fx"}), of.positive({"fl_y", "fy"})};
  const glm::dvec2 centre_px{of.positive({"cx"}), of.positive({"cy"})};
  if (size_px == glm::dvec2(0.0)) size_px = glm::round(2.0 * centre_px);
  glm::dvec2 angle_rad{of.positive({"camera_angle_x"}), of.positive({"camera_angle_y"})};
  if (angle_rad.x == 0.0) angle_rad.x = degree * of.positive({"x_fov"});
  if (angle_rad.y == 0.0) angle_rad.y = degree * of.positive({"y_fov", "fov", "default_fov"});
  Lens lens;
  lens.distortion = distortion_of(camera, file);
  if (no_pinhole(lens.distortion)) return lens;
  const bool sized =
      std::min(size_px.x, size_px.y) >= 1.0 && std::max(size_px.x, size_px.y) <= max_side_px;
  if (sized) lens.size_px = glm::ivec2(size_px);
  for (int axis = 0; axis < 2; ++axis) {
    const double side = lens.size_px[axis];
    if (sized && focal_px[axis] > least_focal_px)
      lens.half_tan[axis] = 0.5 * side / focal_px[axis];
    else if (angle_rad[axis] > 0.0 && angle_rad[axis] < std::numbers::pi)
      lens.half_tan[axis] = std::tan(0.5 * angle_rad[axis]);
    if (sized && centre_px[axis] > 0.0) lens.centre[axis] = centre_px[axis] / side;
  }
  return lens;
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
      listed.world_from_camera = opengl_pose(*matrix, origin);
    } else {
      listed.name = name_of(item, "img_name");
      listed.world_from_camera = training_pose(item, origin);
    }
    listed.lens = read_lens(item, item);
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
    list.cameras.push_back({name_of(frame, "file_path"),
                            opengl_pose(frame.at("transform_matrix"), origin),
                            read_lens(frame, file)});
  }
  return list;
}

CameraList read_path(const JsonField& file, const glm::dvec3& origin) {
  CameraList list;
  const JsonField cameras = file.at("camera_path");
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const JsonField item = cameras[i];
    list.cameras.push_back(
        {"", opengl_pose(item.at("camera_to_world"), origin), read_lens(item, file)});
  }
  const Numbers of{file, file};
  if (const double rate_hz = of.positive({"fps"}); rate_hz > 0.0) {
    list.rate_hz = rate_hz;
  } else if (const double seconds = of.positive({"seconds"});
             seconds > 0.0 && !list.cameras.empty()) {
    list.rate_hz = static_cast<double>(list.cameras.size()) / seconds;
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
