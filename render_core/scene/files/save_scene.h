#pragma once

#include <filesystem>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Writes the cloud in the format that the extension names. The file appears under its name only
/// when it is complete. Throws InputError for an unknown extension and when writing fails.
void save_scene(const GaussianCloud& cloud, const std::filesystem::path& path);

}  // namespace catgs
