#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/frame/depth_grid.h"
#include "render_core/math/camera.h"
#include "render_core/math/stereo.h"
#include "render_core/motion/frame_groups.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/tree/page_figures.h"

namespace catgs {

class DeviceSet;
class PagePools;
class ThreadPool;
class TreeFile;

// One interface for every core. A Renderer owns one scene, with a copy on each of its devices; a
// View is one client's share of one of them (its caches and its output image). Views of a Renderer
// may render at the same time from different threads; one View renders one frame at a time.

enum class Pipeline {
  vanilla,  // the original 3DGS: 3-sigma boxes, 64-bit (tile | depth) key sort, nothing kept
  exact,    // exact ellipse/tile culling; the same image as the reference
  paper,    // CaT-GS as published: key frames (same image as `exact`), then sub-frames
  // The server's: `exact` without what the last frame shows to be hidden. A pixel is finished at
  // least_shown. The CUDA core draws sub-frames where that saves time.
  catgs,
};

/// Whether frames of a pipeline may follow a key frame as its sub-frames.
constexpr bool has_groups(Pipeline pipeline) {
  return pipeline == Pipeline::paper || pipeline == Pipeline::catgs;
}

/// Whether a pipeline may show colours of an earlier frame.
constexpr bool keeps_colours(Pipeline pipeline) {
  return pipeline == Pipeline::paper || pipeline == Pipeline::catgs;
}

enum class PixelFormat {
  rgb_f32,  // one plane, 3 floats a pixel, display-referred, clamped to [0, 1]
  // Three planes, 8 bit, BT.709 limited range, as encoders take them. 4:2:0 with chroma sited at
  // the centre of its 2x2 pixels, as in JPEG; H.264 calls this chroma_sample_loc_type 1.
  i420,
};

enum class MemorySpace { host, device };

/// Stages of a frame, in data-flow order. A core that fuses stages reports 0 for the absorbed one.
enum class Stage { project, bin, sort, blend, convert };
inline constexpr std::size_t stage_count = 5;
inline constexpr std::array<std::string_view, stage_count> stage_names = {"project", "bin", "sort",
                                                                          "blend", "convert"};

struct FrameStats {
  FrameKind kind = FrameKind::key;
  std::uint32_t visible = 0;             // Gaussians that passed culling, counted for each eye
  std::uint64_t list_entries = 0;        // sum of all tile lists
  std::uint32_t list_max = 0;            // longest tile list
  std::uint64_t overflowed_entries = 0;  // list entries that found no memory and were not drawn
  std::uint64_t blended_pairs = 0;       // (Gaussian, pixel) pairs blended; see count_pairs
  std::uint64_t tasks = 0;               // parts into which the tiles were cut for the blend
  // Paged scenes (TreeFile); see scene/tree/cut.h
  std::uint32_t nodes = 0;  // clusters drawn
  // Levels of these nodes; 0: leaves.
  int finest_level = 0, coarsest_level = 0;
  // Not resident at the pool's last update, though memory has room for them.
  std::uint32_t missing_pages = 0;
  float coarsest_px = 0.0f;  // the largest error that memory leaves; 0: none over the detail
  bool settled = true;       // a camera at rest would see no other picture in the next frame
  // Pipelines with groups
  int window = 0;           // key frames: sub-frames promised; sub-frames: that of their key frame
  bool cut_window = false;  // key frames: the window before it ended early
  float displacement_px = 0;  // key frames: longest trail deeper than speculation_min_depth()
  // Over visible Gaussians deeper than speculation_min_depth().
  float nearest_depth = 0;       // world units
  float mean_inverse_depth = 0;  // 1 / world units
  // Times of the drawing that succeeded. A drawing repeated for lack of room is not counted.
  std::array<float, stage_count> stage_ms{};
};

struct FrameRequest {
  Camera camera;
  glm::vec3 background{0.0f};
  // Pipelines with groups; without it no sub-frame follows.
  std::optional<Forecast> forecast{};
  // Scenes in pages: the largest error to be drawn, in pixels; 0 draws every Gaussian.
  float detail_px = 0.0f;
  // Scenes in pages: where the camera may be soon. Pages are read for it, too.
  std::optional<Pose> soon{};
  bool waits_for_pages = false;  // the pages that the frame needs are read before it is drawn
  glm::ivec2 depth_cells{0};     // of FrameView::depths; 0: not wanted. The CUDA core: catgs only
  // Two eyes, side by side in the picture; see eye_camera(). The camera is that of the head, and
  // all poses are. The columns of depths are even. No sub-frame follows.
  std::optional<Stereo> stereo{};
};

/// The cameras that a frame draws: one, or those of both eyes.
std::vector<Camera> cameras_of(const FrameRequest& request);

struct Plane {
  std::byte* data = nullptr;
  std::size_t stride_bytes = 0;
};

/// A finished frame, borrowed from its View: valid until the View's next render() or its end.
struct FrameView {
  PixelFormat format = PixelFormat::rgb_f32;
  MemorySpace space = MemorySpace::host;
  glm::ivec2 size_px{0};
  std::array<Plane, 3> planes{};
  FrameStats stats;
  DepthGrid depths{};
};

/// Outcome of the frame path, which never throws.
struct RenderStatus {
  enum class Code { ok, invalid_request, out_of_memory, device_failed };
  Code code = Code::ok;
  std::string message;  // names stage and cause; empty when ok
  [[nodiscard]] bool ok() const { return code == Code::ok; }
};

struct ViewSettings {
  Pipeline pipeline = Pipeline::exact;
  PixelFormat format = PixelFormat::rgb_f32;
  MemorySpace space = MemorySpace::host;  // of rgb_f32; device: it stays on the device
  std::uint64_t max_list_entries = std::uint64_t{64} << 20;  // bounds the memory of tile lists
  bool count_pairs = false;           // fill FrameStats::blended_pairs; slower
  SpeculationSettings speculation{};  // Pipeline::paper and catgs
  bool colour_cache = true;           // CPU core, catgs and paper: reuse colours while accurate
  bool split_tasks = true;            // CUDA core: long tiles are blended in several parts
};

/// The check that every core makes first: sizes, focal length, near plane, eyes and pose must be in
/// range.
RenderStatus check_request(const FrameRequest& request, PixelFormat format);

class View {
 public:
  virtual ~View() = default;
  View() = default;
  View(const View&) = delete;
  View& operator=(const View&) = delete;

  /// Renders one frame and waits for it. Any image size from 1x1 to max_image_side is accepted and
  /// may change from frame to frame (i420 needs even sides, of each eye). On failure `frame` is
  /// untouched.
  virtual RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept = 0;

  /// Length of each tile's list in the last frame, row by row; empty where the core does not tell.
  /// For analysis, not for every frame: it may wait for the device.
  [[nodiscard]] virtual std::vector<std::uint32_t> tile_loads() const { return {}; }

  /// Memory of this View (caches, lists, image) where its core renders, without the scene.
  [[nodiscard]] virtual std::size_t memory_bytes() const = 0;

  /// Whether the last frame would look better now, as pages of its scene have come since. Call it
  /// between frames.
  [[nodiscard]] virtual bool outdated() const { return false; }

  /// The CUDA device that the View lives on; nothing on other cores.
  [[nodiscard]] virtual std::optional<int> device() const { return std::nullopt; }
};

inline constexpr int max_image_side_px = 8192;

class Renderer {
 public:
  virtual ~Renderer() = default;
  Renderer() = default;
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// For people: "CPU, AVX3_DL, 2 threads", "CUDA, 2 x NVIDIA H200".
  [[nodiscard]] virtual std::string description() const = 0;
  /// Whether Views of this pipeline have windows, where frames come with forecasts.
  [[nodiscard]] virtual bool has_windows(Pipeline pipeline) const {
    return pipeline == Pipeline::paper;
  }
  /// Bytes of the scene on one device; each device holds its own copy. Of a scene in pages, the
  /// memory for pages, which it may share with others.
  [[nodiscard]] virtual std::size_t scene_bytes() const = 0;
  /// The pages of a scene in pages, on each device. May be called from any thread.
  [[nodiscard]] virtual std::vector<PageFigures> pages() const { return {}; }
  /// May be called from any thread. Throws where the device has no room left for the View.
  [[nodiscard]] virtual std::unique_ptr<View> make_view(const ViewSettings& settings) = 0;
};

enum class RendererKind { automatic, cpu, cuda, reference };

struct RendererOptions {
  RendererKind kind = RendererKind::automatic;
  std::shared_ptr<ThreadPool> pool;  // CPU core; null: the Renderer makes its own
  std::string simd = "auto";         // CPU core: auto or an instruction set that this machine has
  std::shared_ptr<DeviceSet> devices{};  // CUDA core; null: device 0
  // Pools that scenes in pages share; null: each scene has one of its own, of `scene_memory` bytes.
  std::shared_ptr<PagePools> pages{};
  std::uint64_t scene_memory = std::uint64_t{4} << 30;
};

/// Refuses options that contradict each other, as make_renderer() does, but before a large scene is
/// read. Throws InputError.
void check(const RendererOptions& options);

struct MadeRenderer {
  std::unique_ptr<Renderer> renderer;
  std::string reason;  // why this core was chosen, for people to read
};

/// Chooses and builds a core for the scene. Throws InputError where the wanted core cannot run or a
/// wanted device does not exist.
MadeRenderer make_renderer(std::shared_ptr<const GaussianCloud> cloud,
                           const RendererOptions& options = {});
/// The same for a scene in pages, of which any part may be in memory. Views have no
/// Pipeline::vanilla, and the reference renderer cannot draw it.
MadeRenderer make_renderer(std::shared_ptr<TreeFile> tree, const RendererOptions& options = {});

}  // namespace catgs
