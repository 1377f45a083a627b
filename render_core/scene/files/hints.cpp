#include "render_core/scene/files/hints.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/content_hash.h"
#include "render_core/base/error.h"
#include "render_core/base/part_file.h"
#include "render_core/base/printable.h"
#include "render_core/math/axis_name.h"
#include "render_core/math/look_at.h"
#include "render_core/scene/files/tour_check.h"
#include "render_core/scene/formats/json_field.h"

namespace catgs {

namespace {

constexpr std::size_t max_about_bytes = 800;  // of one text: 200 characters or more
constexpr const char* hash_field = "convert_hash";

/// A hash of the fields of a sidecar, without that of the hash itself.
std::string hash_of(nlohmann::json document) {
  document.erase(hash_field);
  return fmt::format("{:016x}", content_hash(document.dump()));
}

glm::vec3 parse_up(const JsonField& field) {
  if (field.value().is_string()) {
    const std::optional<glm::vec3> up = axis_named(field.text());
    if (!up) field.fail("is not an axis", "write \"-y\", \"+z\", … or [x, y, z]");
    return *up;
  }
  const glm::dvec3 up = field.vec3();  // squares of large floats overflow a float
  if (glm::length(up) < 1e-6) field.fail("has no direction");
  return glm::normalize(up);
}

Sidecar::StartPose parse_start_pose(const JsonField& field, const glm::dvec3& origin) {
  Sidecar::StartPose pose;
  pose.position = field.at("position").position(origin);
  if (const auto target = field.find("look_at")) {
    if (field.find("orientation")) field.fail("has both 'look_at' and 'orientation'", "keep one");
    pose.look_at = target->position(origin);
    if (*pose.look_at == pose.position) target->fail("is the position itself");
  } else if (const auto orientation = field.find("orientation")) {
    pose.orientation = glm::quat(orientation->orientation());
  } else {
    field.fail("'look_at' or 'orientation' is missing", "a place, or a quaternion x, y, z, w");
  }
  return pose;
}

Bounds parse_limits(const JsonField& field, const glm::dvec3& origin) {
  const Bounds limits{field.at("min").position(origin), field.at("max").position(origin)};
  for (int k = 0; k < 3; ++k)
    if (!(limits.min[k] < limits.max[k])) field.fail("'min' is not below 'max' on every axis");
  return limits;
}

constexpr std::array<std::string_view, 3> mode_names = {"orbit", "fly", "walk"};

std::string parse_line(const std::optional<JsonField>& field) {
  if (!field) return {};
  const std::string text = field->text();
  if (text.size() > max_about_bytes)
    field->fail(fmt::format("has more than {} bytes", max_about_bytes));
  return printable(text);
}

CameraMode parse_mode(const JsonField& field) {
  const auto found = std::ranges::find(mode_names, field.text());
  if (found == mode_names.end())
    field.fail("is not a mode", fmt::format("write {}", fmt::join(mode_names, ", ")));
  return static_cast<CameraMode>(1 + (found - mode_names.begin()));
}

std::uint32_t parse_colour(const JsonField& field) {
  const std::string text = field.text();
  const auto rgb =
      text.starts_with('#') ? parse_rgb(std::string_view(text).substr(1)) : std::nullopt;
  if (!rgb) field.fail("is not a colour", "write \"#rrggbb\" in hexadecimal digits");
  return *rgb;
}

SceneAbout parse_about(const JsonField& root) {
  SceneAbout about{parse_line(root.find("title")), parse_line(root.find("credits")),
                   parse_line(root.find("licence"))};
  if (const auto mode = root.find("mode")) about.mode = parse_mode(*mode);
  if (const auto colour = root.find("background")) about.background_rgb = parse_colour(*colour);
  if (const auto metres = root.find("metres_per_unit")) {
    about.metres_per_unit = metres->number();
    if (!is_metres_per_unit(about.metres_per_unit)) metres->fail("is not in 1e-6…1e6");
  }
  check_translations(root, {"title", "credits"});
  if (const auto translations = root.find("translations"))
    for (const auto& [tag, value] : translations->value().items()) {
      const JsonField words = translations->at(tag);
      about.translations.push_back(
          {tag, parse_line(words.find("title")), parse_line(words.find("credits"))});
    }
  return about;
}

}  // namespace

Sidecar read_sidecar(const ByteSource& file, const glm::dvec3& origin) {
  const nlohmann::json document = read_json(file, max_sidecar_bytes);
  const JsonField root(file.name(), document);
  if (!document.is_object()) root.fail("is not a JSON object");
  static constexpr std::array known = {"up",       "start_pose",      "near",         "limits",
                                       "focus",    "title",           "credits",      "licence",
                                       "mode",     "background",      "model",        "tours",
                                       "measures", "metres_per_unit", "translations", hash_field};
  Sidecar sidecar;
  for (const auto& [key, value] : document.items())
    if (std::ranges::find(known, key) == known.end())
      sidecar.unknown =
          fmt::format("unknown field '{}' (known are {})", key, fmt::join(known, ", "));
  if (const auto up = root.find("up")) sidecar.up = parse_up(*up);
  if (const auto pose = root.find("start_pose"))
    sidecar.start_pose = parse_start_pose(*pose, origin);
  if (const auto near = root.find("near")) {
    sidecar.near_z = near->number();
    if (*sidecar.near_z <= 0.0f) near->fail("is not positive");
    if (*sidecar.near_z > max_coordinate)
      near->fail(fmt::format("is beyond {} units", max_coordinate));
  }
  if (const auto limits = root.find("limits")) sidecar.limits = parse_limits(*limits, origin);
  if (const auto focus = root.find("focus")) sidecar.focus = focus->position(origin);
  sidecar.about = parse_about(root);
  if (const auto model = root.find("model")) {
    sidecar.model = splat_model_named(model->text());
    if (!sidecar.model)
      model->fail("is not a model", fmt::format("write {}", fmt::join(splat_model_names, ", ")));
  }
  return sidecar;
}

void use_sidecar(const Sidecar& sidecar, const std::string& name, SceneHints& hints) {
  if (sidecar.up) hints.up = *sidecar.up;
  if (sidecar.near_z) hints.near_z = *sidecar.near_z;
  if (sidecar.limits) hints.limits = *sidecar.limits;
  if (sidecar.focus) hints.focus = *sidecar.focus;
  if (const auto& start = sidecar.start_pose) {
    hints.start_pose = start->look_at ? look_at(start->position, *start->look_at, hints.up)
                                      : Pose{start->position, start->orientation};
    if (start->look_at && !sidecar.focus) hints.focus = *start->look_at;
  }
  hints.up_is_doubtful = hints.up_is_doubtful && !sidecar.up && !sidecar.start_pose;
  hints.about = sidecar.about;
  hints.source = fmt::format("sidecar {}", name);
}

void note_origin(const glm::dvec3& origin, std::vector<std::string>& notes) {
  if (origin != glm::dvec3(0.0))
    notes.push_back(fmt::format(
        "its origin is [{}, {}, {}] of the file, because floats round places so far from 0; "
        "sidecars, cameras and pages count from 0 as the file does",
        origin.x, origin.y, origin.z));
}

nlohmann::ordered_json json_location(const glm::vec3& point, const glm::dvec3& origin) {
  if (origin == glm::dvec3(0.0)) return {point.x, point.y, point.z};
  const glm::dvec3 in_file = glm::dvec3(point) + origin;
  return {in_file.x, in_file.y, in_file.z};
}

std::filesystem::path sidecar_of(const std::filesystem::path& scene_file) {
  return std::filesystem::path(scene_file).replace_extension(".json");
}

bool is_unedited(const std::filesystem::path& sidecar) {
  try {
    const nlohmann::json document = read_json(FileSource(sidecar), max_sidecar_bytes);
    return document.is_object() &&
           document.value(hash_field, nlohmann::json()) == hash_of(document);
  } catch (const InputError&) {
    return false;  // convert writes no such file
  }
}

void write_sidecar(const SceneHints& hints, const std::filesystem::path& path,
                   const nlohmann::ordered_json* page_fields) {
  const auto point = [&](const glm::vec3& p) { return json_location(p, hints.origin); };
  const glm::quat& q = hints.start_pose.orientation;
  nlohmann::ordered_json document = {
      {"up", {hints.up.x, hints.up.y, hints.up.z}},
      {"start_pose",
       {{"position", point(hints.start_pose.position)}, {"orientation", {q.x, q.y, q.z, q.w}}}},
      {"near", hints.near_z},
      {"limits", {{"min", point(hints.limits.min)}, {"max", point(hints.limits.max)}}},
      {"focus", point(hints.focus)}};
  const SceneAbout& about = hints.about;
  const auto add_said = [&](const char* name, const std::string& text) {
    if (!text.empty()) document[name] = text;
  };
  add_said("title", about.title);
  add_said("credits", about.credits);
  add_said("licence", about.licence);
  if (about.mode != CameraMode::unspecified)
    document["mode"] = mode_names[static_cast<std::size_t>(about.mode) - 1];
  if (about.background_rgb != 0)
    document["background"] = fmt::format("#{:06x}", about.background_rgb);
  if (about.metres_per_unit != 0.0f) document["metres_per_unit"] = about.metres_per_unit;
  for (const auto& [language, title, credits] : about.translations) {
    auto& words = document["translations"][language] = nlohmann::ordered_json::object();
    if (!title.empty()) words["title"] = title;
    if (!credits.empty()) words["credits"] = credits;
  }
  if (page_fields)
    for (const auto& [name, value] : page_fields->items()) document[name] = value;
  document[hash_field] = hash_of(nlohmann::json::parse(document.dump()));
  PartFile file(path);  // a server may read it meanwhile
  file.stream() << document.dump(2) << '\n';
  file.finish();
}

}  // namespace catgs
