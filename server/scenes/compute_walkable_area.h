#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include <glm/vec3.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/files/load_scene.h"
#include "server/net/messages.h"

namespace catgs {

/// All that the walkable area of a scene depends on.
struct WalkableAreaSource {
  SceneLocation scene;
  std::filesystem::path tree;    // of a cache, for scenes too large to be read as a whole
  std::filesystem::path beside;  // a .walk file of the author's; empty: nowhere
  glm::dvec3 start{0.0};         // where visits begin, in the coordinates of the scene's file
  glm::vec3 up{0.0f};            // of the scene as it is shown
  float metres_per_unit = 0.0f;  // 0: not said
};
WalkableAreaSource walkable_area_source(const SceneLocation& scene, const SceneFacts& facts);
/// True if both have the same walkable area as long as the scene's files are the same.
bool same_walkable_area(const WalkableAreaSource& one, const WalkableAreaSource& other);

/// Nobody can walk in the scene.
struct NoWalkableArea : InputError {
  explicit NoWalkableArea(const InputError& why) : InputError(why) {}
};

/// The bytes of a .walk file of the scene, for people of 1.6 m. Where the scene has no unit, the
/// heights of rooms tell their size, and the scene is read up to three times. Takes up to 1.4 GB
/// for cells and 0.5 GB for what is found, beside the scene: that is read part by part where its
/// format allows it, and else as a whole, with 4 M Gaussians at most. `progress` is called often,
/// by several threads at a time, and may throw to cancel. Throws NoWalkableArea, or InputError
/// where the scene cannot be read.
std::string compute_walkable_area(const WalkableAreaSource& source, int threads,
                                  const std::function<void()>& progress);

/// See derived_name(): it changes with the scene's files and with what else `source` says. Throws
/// InputError.
std::string walkable_area_name(const WalkableAreaSource& source);

}  // namespace catgs
