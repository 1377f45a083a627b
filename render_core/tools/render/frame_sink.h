#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "render_core/frame/renderer.h"
#include "render_core/tools/render/frame_layers.h"

namespace catgs {

/// A destination for rendered frames. Writing throws InputError (a full disk, no right to write).
class FrameSink {
 public:
  virtual ~FrameSink() = default;
  FrameSink() = default;
  FrameSink(const FrameSink&) = delete;
  FrameSink& operator=(const FrameSink&) = delete;

  /// Format of the frames that write() takes, always in host memory.
  [[nodiscard]] virtual PixelFormat format() const = 0;
  /// `camera`: that drew the frame, which pictures tell.
  virtual void write(const FrameView& frame, const FrameLayers& layers, const Camera& camera) = 0;
  /// Completes the file. Call it after the last frame; without it the file is unusable.
  virtual void finish() = 0;
};

struct FrameSinkSettings {
  std::filesystem::path path;
  glm::ivec2 size_px{0};
  double fps = 60.0;                 // of a video
  std::size_t first_frame = 0;       // number of the first picture in a folder
  std::vector<std::string> names{};  // of the pictures in a folder, without extension; or numbers
  glm::dvec3 origin{0.0};            // of the scene; pictures tell cameras from the file's 0
  bool tells_cameras = true;         // pictures do
  bool layers = false;               // frames come with layers, which only pictures can hold
};

struct PictureNames {
  std::vector<std::string> names;  // different ones; empty: frame numbers are used
  std::string problem{};           // why they are
};

/// Names of files for the pictures of a path, as compare takes them: without folders and extension,
/// or with underscores for slashes where those would meet. Empty where they cannot be told apart.
PictureNames picture_names(const std::vector<std::string>& of_path);

bool is_video(const std::filesystem::path& path);

/// Chooses by the extension of the path: one .png, a .y4m or .mp4 video (both BT.709 limited range
/// 4:2:0), else a folder of frame_000000.png …, created if missing. A picture holds its frame's
/// camera (picture_camera.h) and alpha; its depth goes into a NumPy file beside it: float32, height
/// x width. Throws InputError.
std::unique_ptr<FrameSink> make_frame_sink(const FrameSinkSettings& settings);

}  // namespace catgs
