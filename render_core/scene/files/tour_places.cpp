#include "render_core/scene/files/tour_places.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>
#include <glm/trigonometric.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/math/camera.h"
#include "render_core/math/look_at.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/json_field.h"

namespace catgs {
namespace {

bool are_numbers(const nlohmann::ordered_json& value, std::size_t count) {
  return value.is_array() && value.size() == count &&
         std::all_of(value.begin(), value.end(), [](const auto& v) { return v.is_number(); });
}

/// Where a point of the scene comes to lie. Throws InputError.
glm::dvec3 placed(const glm::dvec3& point, const Placement& placement) {
  const glm::dvec3 to = placement.map()(point);
  for (int k = 0; k < 3; ++k)
    if (!(std::abs(to[k]) <= static_cast<double>(max_coordinate)))
      throw InputError("placement", "",
                       fmt::format("a place of a tour would lie beyond {} units", max_coordinate),
                       "scale less, or move less far");
  return to;
}

/// The turn of an upright box about the placed scene's vertical, degrees. `up`: of that scene.
double placed_turn(double turn_deg, const Placement& placement, const glm::vec3& up) {
  const glm::quat rotation(placement.rotation);
  const glm::vec3 x(1.0f, 0.0f, 0.0f), up_before = glm::conjugate(rotation) * up;
  const float turn_rad = glm::radians(static_cast<float>(turn_deg));
  const glm::vec3 side =
      rotation * (glm::angleAxis(turn_rad, up_before) * (upright(up_before) * x));
  const glm::vec3 zero = upright(up) * x;
  return glm::degrees(std::atan2(glm::dot(glm::cross(zero, side), up), glm::dot(zero, side)));
}

void place_member(const std::string& name, nlohmann::ordered_json& value,
                  const Placement& placement, const SceneHints& hints) {
  const auto number = [&](std::size_t k) { return value[k].get<double>(); };
  const auto place = [&] {
    const glm::dvec3 to = placed({number(0), number(1), number(2)}, placement);
    return json_location(glm::vec3(to - hints.origin), hints.origin);
  };
  const bool is_position = name == "position" || name == "look_at" || name == "marker";
  const bool is_length = name == "error" || name == "view_height";
  if (is_position && are_numbers(value, 3)) {
    value = place();
  } else if (name == "section" && are_numbers(value, 7)) {
    nlohmann::ordered_json to = place();
    for (std::size_t k = 3; k < 6; ++k) to.push_back(number(k) * placement.scale);
    to.push_back(placed_turn(number(6), placement, hints.up));
    value = std::move(to);
  } else if (name == "orientation" && are_numbers(value, 4)) {
    const glm::quat to(placement.rotation * glm::dquat(number(3), number(0), number(1), number(2)));
    value = {to.x, to.y, to.z, to.w};
  } else if (is_length && value.is_number()) {
    value = value.get<double>() * placement.scale;
  } else if (name == "depth" && are_numbers(value, 3)) {
    const glm::dvec3 to = placement.scale * (glm::dquat(placement.rotation) *
                                             glm::dvec3(number(0), number(1), number(2)));
    value = {to.x, to.y, to.z};
  } else if (name != "portal") {
    place_tours(value, placement, hints);
  }
}

}  // namespace

nlohmann::ordered_json page_fields_in_sidecar(const HintFiles& files) {
  nlohmann::ordered_json fields = nlohmann::ordered_json::object();
  std::error_code error;
  if (files.sidecar.empty() || !std::filesystem::is_regular_file(files.sidecar, error))
    return fields;
  const nlohmann::json document = read_json(FileSource(files.sidecar), max_sidecar_bytes);
  for (const char* name : {"tours", "measures"})
    if (const auto field = document.find(name); field != document.end() && !field->is_null())
      fields[name] = nlohmann::ordered_json(*field);
  return fields;
}

void place_tours(nlohmann::ordered_json& tours, const Placement& placement,
                 const SceneHints& hints) {
  if (tours.is_object()) {
    for (auto&& [name, value] : tours.items()) place_member(name, value, placement, hints);
  } else if (tours.is_array()) {
    for (auto& value : tours) place_tours(value, placement, hints);
  }
}

}  // namespace catgs
