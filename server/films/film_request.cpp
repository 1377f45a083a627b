#include "server/films/film_request.h"

#include <array>
#include <span>
#include <string>

#include <fmt/format.h>
#include <glm/trigonometric.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/json_field.h"
#include "server/net/http.h"

namespace catgs {
namespace {

constexpr std::array<std::string_view, 3> kind_names = {"picture", "panorama", "film"};
constexpr std::array<glm::ivec2, 3> largest_px = {{{7680, 4320}, {8192, 4096}, {1920, 1080}}};
constexpr int least_side_px = 16;

FilmKind read_kind(const JsonField& field) {
  const std::string name = field.text();
  for (std::size_t i = 0; i < kind_names.size(); ++i)
    if (kind_names[i] == name) return static_cast<FilmKind>(i);
  field.fail("is no kind of film", fmt::format("write {}", fmt::join(kind_names, ", ")));
}

glm::ivec2 read_size(const JsonField& field, FilmKind kind) {
  if (field.size() != 2) field.fail("is not width and height", "two numbers, like [1280, 720]");
  const glm::ivec2 most = largest_px[static_cast<std::size_t>(kind)];
  glm::ivec2 size_px{0};
  for (int i = 0; i < 2; ++i) {
    const std::uint64_t side = field[static_cast<std::size_t>(i)].count();
    if (side < least_side_px || side > static_cast<std::uint64_t>(most[i]))
      field.fail(fmt::format("is no size of a {3}: that is between {0}x{0} and {1}x{2} pixels",
                             least_side_px, most.x, most.y,
                             kind_names[static_cast<std::size_t>(kind)]));
    size_px[i] = static_cast<int>(side);
  }
  if (kind == FilmKind::panorama && size_px.x != 2 * size_px.y)
    field.fail("is not twice as wide as high", "a panorama is, like [4096, 2048]");
  if (kind == FilmKind::film && (size_px.x % 2 != 0 || size_px.y % 2 != 0))
    field.fail("has an odd side", "a film has an even width and height");
  return size_px;
}

void read_pose(const JsonField& field, glm::dvec3& position, glm::quat& orientation) {
  const auto number = [&](std::size_t i) { return field[i].precise_number(); };
  position = {number(0), number(1), number(2)};
  static_cast<void>(field.as_position(position));  // in range
  orientation = glm::quat(field.as_orientation({number(6), number(3), number(4), number(5)}));
}

bool is_length(float value) { return value >= 1e-6f && value <= max_coordinate; }

FilmBox read_box(const JsonField& field) {
  if (!field.value().is_array() || field.size() != 10)
    field.fail("is not [x, y, z, qx, qy, qz, qw, half width, half depth, half height]");
  FilmBox box;
  read_pose(field, box.centre, box.orientation);
  for (int k = 0; k < 3; ++k) {
    box.half_extent[k] = field[static_cast<std::size_t>(7 + k)].number();
    if (!is_length(box.half_extent[k])) field.fail("has a side that is not positive");
  }
  return box;
}

FilmView read_view(const JsonField& field, const FilmView* before) {
  const std::size_t count = field.value().is_array() ? field.size() : 0;
  if (count != 8 && count != 9 && !(count == 7 && before))
    field.fail("is not [x, y, z, qx, qy, qz, qw, fov_deg]",
               "give fov_deg in the first view; later ones may leave it out, and a whole number "
               "repeats the view before");
  FilmView view;
  read_pose(field, view.position, view.orientation);
  if (count == 7) {
    view.fov_y_rad = before->fov_y_rad;
    view.view_height = before->view_height;
  } else {
    if (!(field[7].number() >= 5.0f && field[7].number() <= 160.0f))
      field.fail("has a field of view that is not between 5 and 160 degrees");
    view.fov_y_rad = glm::radians(field[7].number());
    if (count == 9) view.view_height = field[8].number();
    if (count == 9 && !is_length(view.view_height))
      field.fail("has a view whose height is not a positive number of world units");
  }
  return view;
}

}  // namespace

FilmRequest parse_film_request(std::string_view json) {
  const MemorySource source("film", std::as_bytes(std::span(json)));
  const nlohmann::json document = read_json(source, max_upload_bytes);
  const JsonField root(source.name(), document);
  FilmRequest request;
  request.kind = read_kind(root.at("kind"));
  request.size_px = read_size(root.at("size"), request.kind);
  if (const auto box = root.find("box")) request.box = read_box(*box);
  const JsonField views = root.at("views");
  const std::size_t most = request.kind == FilmKind::film ? most_film_frames : 1;
  const auto check_count = [&](std::size_t more) {
    if (more > most - request.views.size())
      views.fail(fmt::format("has more than {} view{}", most, most > 1 ? "s" : ""),
                 most > 1 ? "a film lasts ten minutes at most" : "only a film has several");
  };
  for (std::size_t i = 0; i < views.size(); ++i) {
    const JsonField entry = views[i];
    const FilmView* const before = request.views.empty() ? nullptr : &request.views.back();
    if (before && entry.value().is_number()) {
      const std::uint64_t times = entry.count();
      check_count(times);
      request.views.insert(request.views.end(), times, FilmView(*before));
    } else {
      check_count(1);
      request.views.push_back(read_view(entry, before));
    }
  }
  if (request.views.empty()) views.fail("is empty", "give at least one view");
  return request;
}

}  // namespace catgs
