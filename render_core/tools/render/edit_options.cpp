#include "render_core/tools/render/edit_options.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <numbers>
#include <string_view>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>

#include "render_core/base/error.h"
#include "render_core/math/camera.h"
#include "render_core/tools/parse_values.h"

namespace catgs {
namespace {

constexpr double largest_scale = 1e6;

/// About the axes x, y and z, one after the other.
glm::dquat parse_rotation(std::string_view text) {
  const auto degrees = parse_numbers<3>("--rotate", text, "-90,0,0");
  glm::dquat rotation(1.0, 0.0, 0.0, 0.0);
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<std::size_t>(axis);
    glm::dvec3 about(0.0);
    about[axis] = 1.0;
    rotation = glm::angleAxis(degrees[k] * std::numbers::pi / 180.0, about) * rotation;
  }
  return glm::normalize(rotation);
}

CropBox parse_box(std::string_view text) {
  const auto box = parse_numbers<6>("--crop", text, "-2,-1,-2,2,1,2");
  const CropBox bounds{{box[0], box[1], box[2]}, {box[3], box[4], box[5]}};
  for (int k = 0; k < 3; ++k)
    if (!(bounds.min[k] < bounds.max[k]))
      throw InputError("--crop", std::string_view("xyz").substr(static_cast<std::size_t>(k), 1),
                       fmt::format("{} is not below {}", bounds.min[k], bounds.max[k]),
                       "the lower corner comes first: x0,y0,z0,x1,y1,z1");
  return bounds;
}

void parse_merge(std::string_view text, SceneEdit& edit) {
  if (text.ends_with('%')) {
    double percent = 0.0;
    if (parse_whole(text.substr(0, text.size() - 1), percent) && percent > 0.0 &&
        percent <= 100.0) {
      edit.merge_fraction = 0.01 * percent;
      return;
    }
  } else if (parse_whole(text, edit.merge_to) && edit.merge_to > 0) {
    return;
  }
  throw InputError("--merge", "",
                   fmt::format("\"{}\" is neither a number of Gaussians nor a share", text),
                   "like 500000 or 25%");
}

}  // namespace

void add_edit_options(CLI::App& command, EditOptions& options) {
  constexpr const char* group = "Editing, in this order";
  const auto add = [&](const char* name, auto& value, const char* text) {
    return command.add_option(name, value, text)->group(group);
  };
  add("--scale", options.scale, "Scale the scene about the origin")->capture_default_str();
  add("--rotate", options.rotate,
      "Turn it by X,Y,Z degrees about the axes x, then y, then z, by the right-hand rule");
  add("--translate", options.translate, "Move it by X,Y,Z, in units of the output");
  add("--crop", options.crop,
      "Keep the Gaussians whose centres lie in the box X0,Y0,Z0,X1,Y1,Z1, in axes and units of the "
      "output");
  command
      .add_flag("--remove-floaters", options.remove_floaters,
                "Remove Gaussians that float apart from all surfaces")
      ->group(group);
  CLI::Option* keep =
      add("--keep-fraction", options.keep_fraction,
          "Keep the most important share of the Gaussians, by opacity times mean projected area");
  keep->capture_default_str();
  add("--merge", options.merge,
      "Join Gaussians until this many are left, or this share, like 25%. Looks better than "
      "--keep-fraction and takes longer")
      ->excludes(keep);
}

SceneEdit edit_of(const EditOptions& options) {
  SceneEdit edit;
  if (!(options.scale >= 1.0 / largest_scale && options.scale <= largest_scale))
    throw InputError("--scale", "", fmt::format("{} is not a scale", options.scale),
                     fmt::format("{} to {}", 1.0 / largest_scale, largest_scale));
  edit.placement.scale = options.scale;
  if (options.rotate) edit.placement.rotation = parse_rotation(*options.rotate);
  if (options.translate) {
    const auto by = parse_numbers<3>("--translate", *options.translate, "0,1.5,0");
    edit.placement.offset = {by[0], by[1], by[2]};
  }
  if (options.crop) edit.crop = parse_box(*options.crop);
  edit.remove_floaters = options.remove_floaters;
  if (!(options.keep_fraction > 0.0 && options.keep_fraction <= 1.0))
    throw InputError("--keep-fraction", "",
                     fmt::format("{} is not in (0, 1]", options.keep_fraction));
  edit.keep_fraction = options.keep_fraction;
  if (options.merge) parse_merge(*options.merge, edit);
  return edit;
}

void print_counts(const EditCounts& counts) {
  const auto print = [](std::size_t count, std::string_view what) {
    if (count > 0) fmt::print("{} {}\n", count, what);
  };
  print(counts.cropped, "Gaussians outside of the box were cropped");
  print(counts.floaters, "floating Gaussians were removed");
  print(counts.pruned, "least important Gaussians were pruned");
  print(counts.merged, "Gaussians were merged into others");
}

}  // namespace catgs
