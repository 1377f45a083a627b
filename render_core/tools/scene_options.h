#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/base/cli_fwd.h"
#include "render_core/math/lens.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// A scene to load. The options belong to the caller and must outlive the command's callback.
struct SceneOptions {
  std::string path;
  std::optional<int> lod;
  std::optional<std::size_t> budget;
  std::optional<std::string> up;
  std::optional<std::string> model;
};
/// The path is the command's next positional argument.
void add_scene_options(CLI::App& command, SceneOptions& options, const std::string& name = "scene");

/// The model that --model names.
std::optional<SplatModel> model_of(const SceneOptions& options);

/// The direction that --up names. Throws InputError.
std::optional<glm::vec3> up_of(const SceneOptions& options);

/// Loads the scene of the options. Shows its progress on a terminal. Throws InputError.
Scene load_scene(const SceneOptions& options, int threads, bool quiet);
/// The same for a scene that was located. `first_view`: see LoadOptions.
Scene load_scene(const SceneLocation& location, const SceneOptions& options, int threads,
                 bool quiet, bool first_view = true);

/// The same for a scene in pages.
SceneInPages open_in_pages(const SceneLocation& location, const SceneOptions& options, int threads,
                           bool quiet);

inline constexpr float default_fov_y_deg = 60.0f;

/// A camera without a pose.
struct LensOptions {
  std::string size = "1280x720";
  std::optional<float> focal_px;
  std::optional<float> fov_y_deg;
  std::optional<float> near_z;
  std::optional<float> orthographic{};  // height of the view, world units
  std::string clip{};                   // "nx,ny,nz,offset"; empty: no clip plane
  std::string section{};                // "x,y,z,width,depth,height,turn"; empty: no section box
  bool size_given = false;

  /// Whether the user has said anything about the field of view.
  [[nodiscard]] bool view_given() const { return focal_px || fov_y_deg || orthographic; }
};
void add_lens_options(CLI::App& command, LensOptions& options);

/// `lens` gives what the options leave open, as far as it is known. Without --near the
/// near plane is that of the hints. What is clipped counts from the hints' origin, though the
/// options count from the file's 0. Throws InputError.
Camera make_lens(const LensOptions& options, const SceneHints& hints, const Lens& lens = {});

/// The cameras of the poses of a path that `file` describes, without their poses. One, where the
/// path has one lens or none, or where the options tell the field of view. Says on stderr what
/// people should know about the lenses. Throws InputError where a lens cannot be drawn with.
std::vector<Camera> make_lenses(const LensOptions& options, const SceneHints& hints,
                                const std::string& file, const std::vector<Lens>& lenses);

/// "1920x1080" -> (1920, 1080); sides of 1…max_image_side_px. `flag` names the source in errors.
glm::ivec2 parse_size(std::string_view flag, std::string_view text);

}  // namespace catgs
