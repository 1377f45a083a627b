#include "render_core/scene/files/tour_places.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <system_error>

#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/math/camera.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/json_field.h"

namespace catgs {
namespace {

bool are_numbers(const nlohmann::ordered_json& value, std::size_t count) {
  return value.is_array() && value.size() == count &&
         std::all_of(value.begin(), value.end(), [](const auto& v) { return v.is_number(); });
}

void place_member(const std::string& name, nlohmann::ordered_json& value,
                  const Placement& placement, const glm::dvec3& origin) {
  const auto number = [&](std::size_t k) { return value[k].get<double>(); };
  const bool is_position = name == "position" || name == "look_at" || name == "marker";
  if (is_position && are_numbers(value, 3)) {
    const glm::dvec3 to = placement.map()({number(0), number(1), number(2)});
    for (int k = 0; k < 3; ++k)
      if (!(std::abs(to[k]) <= static_cast<double>(max_coordinate)))
        throw InputError("placement", "",
                         fmt::format("a place of a tour would lie beyond {} units", max_coordinate),
                         "scale less, or move less far");
    value = json_location(glm::vec3(to - origin), origin);
  } else if (name == "orientation" && are_numbers(value, 4)) {
    const glm::quat to(placement.rotation * glm::dquat(number(3), number(0), number(1), number(2)));
    value = {to.x, to.y, to.z, to.w};
  } else if (name == "error" && value.is_number()) {
    value = value.get<double>() * placement.scale;
  } else if (name == "depth" && are_numbers(value, 3)) {
    const glm::dvec3 to = placement.scale * (glm::dquat(placement.rotation) *
                                             glm::dvec3(number(0), number(1), number(2)));
    value = {to.x, to.y, to.z};
  } else if (name != "portal") {
    place_tours(value, placement, origin);
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
                 const glm::dvec3& origin) {
  if (tours.is_object()) {
    for (auto&& [name, value] : tours.items()) place_member(name, value, placement, origin);
  } else if (tours.is_array()) {
    for (auto& value : tours) place_tours(value, placement, origin);
  }
}

}  // namespace catgs
