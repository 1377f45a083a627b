#include "render_core/tools/scene_options.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vector_relational.hpp>

#include "render_core/base/error.h"
#include "render_core/base/printable.h"
#include "render_core/frame/renderer.h"
#include "render_core/math/axis_name.h"
#include "render_core/math/look_at.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/tools/parse_values.h"
#include "render_core/tools/progress.h"

namespace catgs {
namespace {

LoadOptions load_options(const SceneOptions& options, int threads, Progress& progress) {
  LoadOptions load;
  load.lod = options.lod;
  load.gaussian_budget = options.budget;
  load.up = up_of(options);
  load.model = model_of(options);
  load.threads = threads;
  load.progress = [&progress](double fraction) { progress.update(fraction); };
  return load;
}

}  // namespace

void add_scene_options(CLI::App& command, SceneOptions& options, const std::string& name) {
  command.add_option(name, options.path, "Scene file or folder")->required();
  auto* lod = command.add_option(
      "--lod", options.lod,
      "Streamed SOG, 3D Tiles, LCC, LCC2: level of detail to load; 0 is the finest");
  command
      .add_option("--budget", options.budget,
                  "Streamed SOG, 3D Tiles, LCC, LCC2: load the finest levels with at most so many "
                  "Gaussians")
      ->excludes(lod);
  command.add_option("--up", options.up,
                     "Axis that points up, like +z, where no sidecar says so [estimated]");
  command
      .add_option("--model", options.model,
                  "What the Gaussians were trained to be [what the sidecar or the file says]")
      ->check(CLI::IsMember(
          std::vector<std::string>(splat_model_names.begin(), splat_model_names.end())));
}

std::optional<SplatModel> model_of(const SceneOptions& options) {
  return options.model ? splat_model_named(*options.model) : std::nullopt;
}

std::optional<glm::vec3> up_of(const SceneOptions& options) {
  if (!options.up) return std::nullopt;
  const std::optional<glm::vec3> up = axis_named(*options.up);
  if (!up)
    throw InputError("--up", "", fmt::format("\"{}\" is not an axis", *options.up),
                     "one of +x, -x, +y, -y, +z and -z; a sidecar takes any direction");
  return up;
}

Scene load_scene(const SceneOptions& options, int threads, bool quiet) {
  return load_scene(locate_scene(options.path), options, threads, quiet);
}

Scene load_scene(const SceneLocation& location, const SceneOptions& options, int threads,
                 bool quiet, bool first_view) {
  Progress progress("loading", quiet);
  LoadOptions load = load_options(options, threads, progress);
  load.first_view = first_view;
  return load_scene(location, load);
}

SceneInPages open_in_pages(const SceneLocation& location, const SceneOptions& options, int threads,
                           bool quiet) {
  Progress progress("opening", quiet);
  return open_in_pages(location, load_options(options, threads, progress));
}

void add_lens_options(CLI::App& command, LensOptions& options) {
  command
      .add_option(
          "--size", options.size,
          "Width x height, pixels, in place of the size that a path's file tells. Another "
          "shape keeps the lens's vertical angle, or the horizontal one if that is all that "
          "the file tells")
      ->each([&options](const std::string&) { options.size_given = true; })
      ->capture_default_str();
  auto* focal = command.add_option("--focal-px", options.focal_px, "Focal length, pixels");
  auto* fov =
      command
          .add_option(
              "--fov-deg", options.fov_y_deg,
              fmt::format("Vertical field of view, degrees (default: the lens of the path's "
                          "file, or {})",
                          default_fov_y_deg))
          ->excludes(focal);
  command
      .add_option("--orthographic", options.orthographic,
                  "Parallel rays, for plans and elevations: height of the view, world units")
      ->excludes(focal)
      ->excludes(fov);
  command.add_option("--near", options.near_z,
                     "Near plane, world units (default: the scene's hint)");
  auto* plane = command.add_option(
      "--clip", options.clip,
      "Leave out Gaussians whose centre c has dot(N, c) > D, given as NX,NY,NZ,D "
      "in the coordinates of the scene's file. It takes the roof off a house");
  command
      .add_option(
          "--section", options.section,
          "Draw only Gaussians with their centre in an upright box, given as "
          "X,Y,Z,WIDTH,DEPTH,HEIGHT,TURN: its middle in the coordinates of the scene's file, "
          "its sides in world units, its turn about the vertical in degrees")
      ->excludes(plane);
}

namespace {

/// The box of --section: it stands upright, turned about the vertical.
ClipBox section_box(std::string_view text, const SceneHints& hints) {
  const auto n = parse_numbers<7>("--section", text, "0,0,0,8,6,2.5,0");
  const glm::vec3 half_extent = 0.5f * glm::vec3(n[3], n[4], n[5]);
  if (!glm::all(glm::greaterThan(half_extent, glm::vec3(0.0f))))
    throw InputError(
        "--section", "", "has a side that is not positive",
        "X,Y,Z is the middle, then WIDTH,DEPTH,HEIGHT in world units, TURN in degrees");
  const glm::quat turn = glm::angleAxis(glm::radians(static_cast<float>(n[6])), hints.up);
  return oriented_box(glm::dvec3(n[0], n[1], n[2]) - hints.origin, turn * upright(hints.up),
                      half_extent);
}

void clip(Camera& camera, const LensOptions& options, const SceneHints& hints) {
  if (!options.section.empty()) camera.clip = section_box(options.section, hints);
  if (options.clip.empty()) return;
  const auto plane = parse_numbers<4>("--clip", options.clip, "0,1,0,2.5");
  const glm::dvec3 normal(plane[0], plane[1], plane[2]);
  camera.clip = clip_plane(normal, static_cast<float>(plane[3] - glm::dot(normal, hints.origin)));
  if (camera.clip.axes[0] == glm::vec3(0.0f))
    throw InputError("--clip", "", "has a normal of 0, which is not a direction",
                     "NX,NY,NZ points to what is left out, like 0,1,0");
}

}  // namespace

Camera make_lens(const LensOptions& options, const SceneHints& hints, const Lens& lens) {
  const bool own_size = !options.size_given && lens.size_px.x > 0;
  const glm::ivec2 size_px = own_size ? lens.size_px : parse_size("--size", options.size);
  const float fov_y_rad =
      options.fov_y_deg.value_or(default_fov_y_deg) * std::numbers::pi_v<float> / 180.0f;
  float focal_px = options.focal_px.value_or(focal_from_fov_y(fov_y_rad, size_px.y));
  if (options.orthographic) focal_px = static_cast<float>(size_px.y) / *options.orthographic;
  if (!(std::isfinite(focal_px) && focal_px > 0.0f)) {
    throw InputError("--focal-px, --fov-deg, --orthographic", "",
                     "the focal length must be positive",
                     "a field of view lies between 0 and 180 degrees, a view's height over 0");
  }
  if (options.near_z && !(std::isfinite(*options.near_z) && *options.near_z > 0.0f)) {
    throw InputError("--near", "",
                     fmt::format("{} is not a positive, finite distance", *options.near_z),
                     "world units; without it, the scene's hint");
  }
  Camera camera = lens.known() && !options.view_given() ? make_camera(lens, size_px)
                                                        : make_camera({}, size_px, focal_px);
  camera.orthographic = options.orthographic.has_value();
  camera.near_z = options.near_z.value_or(hints.near_z);
  clip(camera, options, hints);
  return camera;
}

std::vector<Camera> make_lenses(const LensOptions& options, const SceneHints& hints,
                                const std::string& file, const std::vector<Lens>& lenses) {
  if (lenses.empty()) return {make_lens(options, hints)};
  const Lens& first = lenses.front();
  if (!options.size_given &&
      !std::ranges::all_of(lenses, [&](const Lens& lens) { return lens.size_px == first.size_px; }))
    throw InputError(file, "", "its pictures have several sizes", "choose one with --size");
  if (options.view_given()) return {make_lens(options, hints, first)};
  const auto note = [&](const std::string& text) {
    fmt::print(stderr, "note: {}: {}\n", printable(file), text);
  };
  const bool one_known = std::ranges::any_of(lenses, &Lens::known);
  std::set<std::string_view> distortions;
  for (const Lens& lens : lenses) {
    if (!lens.known() && (one_known || !lens.distortion.empty()))
      throw InputError(file, "",
                       lens.distortion.empty()
                           ? "some of its cameras tell no lens"
                           : fmt::format("no perspective picture shows {}", lens.distortion),
                       "choose one with --fov-deg or --focal-px");
    if (!lens.distortion.empty()) distortions.insert(lens.distortion);
  }
  if (!distortions.empty())
    note(fmt::format("drawn as a pinhole camera, without its {}{}", *distortions.begin(),
                     distortions.size() > 1
                         ? fmt::format(", and {} others without theirs", distortions.size() - 1)
                         : ""));
  std::vector<Camera> cameras;
  for (const Lens& lens : lenses) cameras.push_back(make_lens(options, hints, lens));
  const bool alike = std::ranges::all_of(
      cameras, [&](const Camera& camera) { return same_lens(camera, cameras.front()); });
  if (alike) cameras.resize(1);
  if (!one_known)
    note(fmt::format("tells no lens; {} degrees are drawn (--fov-deg)", default_fov_y_deg));
  else if (!options.size_given && first.size_px.x == 0)
    note(fmt::format("tells no size; {} is drawn (--size)", options.size));
  return cameras;
}

glm::ivec2 parse_size(std::string_view flag, std::string_view text) {
  const std::size_t cross = std::min(text.find('x'), text.size());
  glm::ivec2 size_px{0};
  const bool whole = cross < text.size() && parse_whole(text.substr(0, cross), size_px.x) &&
                     parse_whole(text.substr(cross + 1), size_px.y);
  if (!whole || std::min(size_px.x, size_px.y) < 1 ||
      std::max(size_px.x, size_px.y) > max_image_side_px) {
    throw InputError(flag, "", fmt::format("\"{}\" is not a picture size", text),
                     fmt::format("like 1280x720, sides of 1 to {}", max_image_side_px));
  }
  return size_px;
}

}  // namespace catgs
