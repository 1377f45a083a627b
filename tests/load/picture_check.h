#pragma once

#include <string>

#include "tests/load/run_report.h"

namespace catgs::load {

/// Renders `scene` (a file, or synth:KIND:COUNT) with the exact pipeline at each kept picture's
/// pose and sets its PSNR, over RGB in [0, 1]. A core and a thread pool of this process do it.
/// Throws InputError for a scene that cannot be read, and where sessions saw another scene than
/// that.
void check_pictures(const std::string& scene, RunReport& report);

/// Converts a decoder's picture to RGB in [0, 1]: from BT.709 limited range, or from JFIF if it is
/// full range. A chroma sample serves its four pixels.
std::vector<float> rgb_of(const DecodedPicture& picture);

}  // namespace catgs::load
