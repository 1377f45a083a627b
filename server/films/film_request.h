#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/math/camera.h"

namespace catgs {

enum class FilmKind { picture, panorama, film };

struct FilmView {
  glm::dvec3 position{0.0};  // in the coordinates of the scene's file
  glm::quat orientation{1.0f, 0.0f, 0.0f, 0.0f};
  float fov_y_rad = 1.0f;
  float view_height = 0.0f;  // world units, of an orthographic view; 0: perspective

  bool operator==(const FilmView&) const = default;
  [[nodiscard]] Pose pose_about(const glm::dvec3& origin) const {
    return {glm::vec3(position - origin), orientation};
  }
};

/// An oriented box, outside of which nothing is drawn.
struct FilmBox {
  glm::dvec3 centre{0.0};  // in the coordinates of the scene's file
  glm::quat orientation{1.0f, 0.0f, 0.0f, 0.0f};
  glm::vec3 half_extent{1.0f};
};

/// A picture or a film that an author wants of a scene.
struct FilmRequest {
  FilmKind kind = FilmKind::picture;
  glm::ivec2 size_px{0};
  std::vector<FilmView> views;  // one, or one for each frame of a film
  std::optional<FilmBox> box{};
};

inline constexpr int film_fps = 30;
inline constexpr std::size_t most_film_frames = 18'000;  // ten minutes

/// Reads {"kind": "film", "size": [1280, 720], "views": [[x, y, z, qx, qy, qz, qw, fov_deg], 30,
/// …]}. A view without its last number keeps the field of view before. A ninth number is the height
/// of an orthographic view. A whole number in place of a view repeats the view before so often.
/// "box" may be [x, y, z, qx, qy, qz, qw, half width, half depth, half height]. Sizes: a picture
/// at most 7680x4320, a panorama 2:1 and at most 8192x4096, a film even and at most 1920x1080.
/// Throws InputError that names the field.
FilmRequest parse_film_request(std::string_view json);

}  // namespace catgs
