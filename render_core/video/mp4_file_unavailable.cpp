#include "render_core/base/error.h"
#include "render_core/video/video_file.h"

namespace catgs {

std::unique_ptr<VideoFile> make_mp4_file(const VideoSettings& settings) {
  throw InputError(settings.path, "", "this build cannot write .mp4: it was made without libav",
                   "install libavformat-dev and libavcodec-dev and build again, or write .y4m");
}

}  // namespace catgs
