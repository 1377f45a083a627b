#pragma once

#include <memory>
#include <string>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/image/image.h"
#include "tests/load/run_report.h"

namespace catgs::load {

/// The name that a session's scene has if it is `scene`: a file, or synth:KIND:COUNT. Throws
/// InputError where the file is not there.
std::string scene_name(const std::string& scene);

/// Draws the exact pictures of scenes, with a core of this process. One scene is in memory at a
/// time.
class ExactPictures {
 public:
  /// Files, or synth:KIND:COUNT.
  explicit ExactPictures(std::vector<std::string> scenes);
  ~ExactPictures();

  /// Throws InputError for a scene that cannot be read, and where none has that id.
  Image draw(const std::string& scene_id, const Camera& camera,
             const std::optional<Stereo>& stereo = {});

 private:
  void load(const std::string& scene_id);

  struct Loaded;
  std::vector<std::string> scenes_;
  std::shared_ptr<ThreadPool> pool_;
  std::unique_ptr<Loaded> loaded_;
};

/// Sets the PSNR of each kept picture, over RGB in [0, 1], against the exact one at its pose.
/// Throws as ExactPictures does.
void check_pictures(const std::vector<std::string>& scenes, RunReport& report);

/// Mean squared error over the pixels and channels of two pictures of one size.
double mean_squared_error(const Image& a, const Image& b);

/// Converts a decoder's picture to RGB in [0, 1]: from BT.709 limited range, or from JFIF if it is
/// full range. A chroma sample serves its four pixels.
Image rgb_of(const DecodedPicture& picture);

}  // namespace catgs::load
