#pragma once

#include <filesystem>

#include "render_core/image/image.h"

namespace catgs {

/// Whether the extension is that of a file which read_picture() may read.
bool is_picture(const std::filesystem::path& path);

/// Reads a PNG or a JPEG of up to max_image_side_px per side; the content tells which. Throws
/// InputError.
Image read_picture(const std::filesystem::path& path);

/// The orientation that a camera notes is ignored, as by COLMAP. Throws InputError, also where the
/// build has no TurboJPEG.
Image read_jpeg(const std::filesystem::path& path);

}  // namespace catgs
