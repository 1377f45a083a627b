#include "render_core/base/error.h"
#include "render_core/tools/picture.h"

namespace catgs {

Image read_jpeg(const std::filesystem::path& path) {
  throw InputError(path.string(), "", "this build cannot read JPEG: it was made without TurboJPEG",
                   "install libturbojpeg0-dev and build again, or use PNG");
}

}  // namespace catgs
