#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "render_core/base/cli_fwd.h"
#include "render_core/base/thread_pool.h"
#include "render_core/frame/renderer.h"
#include "render_core/motion/camera_path.h"
#include "render_core/motion/predictor.h"
#include "render_core/motion/script.h"
#include "render_core/scene/scene.h"
#include "render_core/tools/pipeline_options.h"
#include "render_core/tools/scene_options.h"

namespace catgs {

/// The common options of `frames`, `bench` and `paper`: a scene, a camera path and a renderer.
struct RenderOptions {
  SceneOptions scene;
  std::string trace;
  double trace_rate_hz = default_pose_rate_hz;
  bool anchor = false;
  std::string script;
  // For the script. Unset fields keep the default of ScriptOptions.
  std::optional<std::uint64_t> seed;
  std::optional<double> duration_s;
  LensOptions lens;
  bool stereo = false;
  std::optional<float> eye_distance;  // world units
  std::optional<double> fps;
  std::optional<double> most_fps;  // without `fps`: a trace with more is resampled
  std::string frames;
  std::string renderer = "auto";
  std::string device;  // empty: the first device, if CUDA renders
  PipelineOptions pipeline;
  std::optional<float> detail_px;  // trees; one of the two: the scene is drawn from pages
  std::optional<double> scene_memory_gb;
  std::string simd = "auto";

  [[nodiscard]] bool in_pages() const { return detail_px || scene_memory_gb; }
  int threads = 0;
};

/// The options belong to the caller and must outlive the command's callback.
void add_render_options(CLI::App& command, RenderOptions& options);
/// The options that name neither scene nor path nor pipeline.
void add_frame_options(CLI::App& command, RenderOptions& options);
/// Those of pictures with two eyes.
void add_stereo_options(CLI::App& command, RenderOptions& options);

/// The options, loaded and checked.
struct RenderSetup {
  Scene scene;                                 // its cloud has moved to `cloud`
  std::shared_ptr<const GaussianCloud> cloud;  // of a scene in pages, an outline
  std::shared_ptr<TreeFile> tree;              // a scene in pages; otherwise null
  float detail_px = 0.0f;
  std::shared_ptr<ThreadPool> pool;
  MadeRenderer made;
  ViewSettings view;               // pipeline and its parts; callers set format and memory space
  PredictorSettings predictor;     // of the paper pipeline's forecasts
  Trajectory samples;              // the camera as recorded
  Trajectory poses;                // one per frame
  std::size_t first = 0;           // number of poses[0] in the whole path
  double fps = 0.0;                // of the path
  std::vector<std::string> names;  // of the frames' pictures, as the path's file has them; or none
  Camera camera;                   // without the pose; of the first frame; in stereo of each eye
  std::optional<float> eye_distance;  // world units; none: one eye
  std::vector<Camera> lenses;         // one per frame, where the path has several; else empty
  glm::vec3 background{0.0f};

  /// Size of the pictures.
  [[nodiscard]] glm::ivec2 picture_px() const {
    return camera.size_px * glm::ivec2(eye_distance ? 2 : 1, 1);
  }
  /// The request for frame i alone, without a forecast; see FrameFeed. It waits for pages.
  [[nodiscard]] FrameRequest request(std::size_t i) const;
  /// Gaussians of the whole scene.
  [[nodiscard]] std::uint64_t gaussians() const;
  /// The scene_hash() of a scene in memory, the header's checksum of a tree: hexadecimal.
  [[nodiscard]] std::string hash() const;
  /// The cloud, for what needs all Gaussians. Throws InputError naming `flag` if the scene is in
  /// pages.
  [[nodiscard]] const GaussianCloud& whole_cloud(std::string_view flag) const;
};

/// Loads scene and path, makes the renderer. What the options of the lens leave open is taken from
/// the path's file, if that has a lens. Throws InputError.
RenderSetup prepare(const RenderOptions& options, bool quiet);
/// Loads the scene, then set_path() a path; for several paths through one scene, which are all
/// drawn with the lens of the options.
RenderSetup prepare_scene(const RenderOptions& options, bool quiet);
void set_path(RenderSetup& setup, const RenderOptions& options);

/// Adds --trace-rate for `rate_hz`.
void add_trace_rate_option(CLI::App& command, double& rate_hz);

/// The script that the options describe, as set_path() makes it.
ScriptOptions script_options(const RenderOptions& options);
/// Throws InputError where an option of scripts is given. Without a script it would have no effect
/// and spoil a comparison silently.
void refuse_script_options(const RenderOptions& options);

/// The choice of core, checked; it has no thread pool. Throws InputError.
RendererOptions renderer_options(const RenderOptions& options);

/// "A:B" -> frames A to B - 1 of `count`; either bound may be missing; "" is all. Throws InputError
/// when no frame is left.
struct FrameRange {
  std::size_t begin, end;
};
FrameRange parse_frame_range(std::string_view text, std::size_t count);

/// Renders frame `i` of the path or throws: InputError for a request that the core refuses, else
/// std::runtime_error.
void render_or_throw(View& view, const FrameRequest& request, FrameView& frame);

/// Mean squared error of the rendered rgb_f32 frame `i` of the path against the reference, at
/// `count` random pixels (the same for the same frame of the path).
double reference_error(const RenderSetup& setup, std::size_t i, const FrameView& frame,
                       std::size_t count);

}  // namespace catgs
