#pragma once

#include <functional>
#include <memory>
#include <string>

#include <glm/vec2.hpp>

#include "render_core/frame/renderer.h"

namespace catgs {

/// A video that is being written. Every function throws InputError (a full disk, no right to
/// write).
class VideoFile {
 public:
  virtual ~VideoFile() = default;
  VideoFile() = default;
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  /// Adds an i420 frame of the settings' size in host memory.
  virtual void write(const FrameView& frame) = 0;
  /// Completes the file. Call it after the last frame; without it the file is unusable.
  virtual void finish() = 0;
};

struct VideoSettings {
  std::string path;
  glm::ivec2 size_px{0};  // even sides
  double fps = 30.0;
  int threads = 0;  // of the encoder; 0: as many as it likes
  /// Called between frames of the encoder, and often while bytes are written. What it throws, the
  /// function of the VideoFile throws: the file is then unusable.
  std::function<void()> progress = [] {};
};

/// H.264 in MP4 through libavformat and libx264, BT.709 limited range 4:2:0. Players can begin
/// before they have the whole file. Throws InputError where the build has no libav.
std::unique_ptr<VideoFile> make_mp4_file(const VideoSettings& settings);

}  // namespace catgs
