#include "render_core/base/error.h"
#include "render_core/tools/render/frame_sink.h"

namespace catgs {

std::unique_ptr<FrameSink> make_mp4_sink(const FrameSinkSettings& settings) {
  throw InputError(settings.path.string(), "",
                   "this build cannot write .mp4: it was made without libav",
                   "install libavformat-dev and libavcodec-dev and build again, or write .y4m");
}

}  // namespace catgs
