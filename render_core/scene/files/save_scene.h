#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Throws InputError if save_scene has no writer for a file of this name.
void check_can_be_saved(const std::filesystem::path& path);

/// Whether a file of this name can tell the model.
bool keeps_model(const std::filesystem::path& path, SplatModel model);

/// Says what a file of this name would not hold of the cloud, for people. Throws InputError as
/// save_scene() does.
std::vector<std::string> losses_of(const GaussianCloud& cloud, const std::filesystem::path& path);

/// Whether a file of this name has the coordinates of a cloud that is about another origin than 0.
bool keeps_origin(const std::filesystem::path& path);

/// Writes the cloud in the format that the extension names. The file appears under its name only
/// when it is complete. `threads`: 0 means one per processor. The cloud is about `origin`; a format
/// that cannot keep it has the cloud as it is. Throws InputError as check_can_be_saved does, and
/// when writing fails.
void save_scene(const GaussianCloud& cloud, const std::filesystem::path& path, int threads = 0,
                const glm::dvec3& origin = glm::dvec3(0.0));

}  // namespace catgs
