#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/tree/tree_file.h"

namespace catgs {

/// A scene that is read part by part, so that it need not fit into memory.
struct SceneParts {
  /// Calls `take` with every part, in the same order with the same bits each time it is called. The
  /// parts share one SH degree and one model, and are sanitized. Returns how many Gaussians were
  /// dropped.
  std::function<std::uint64_t(const std::function<void(const GaussianCloud&)>& take)> each;
  std::string format;      // of the scene, for people
  bool in_memory = false;  // whether the parts are in memory anyway, so that calling costs nothing
  glm::dvec3 origin{0.0};  // that the parts are about
};

/// Builds a tree of the scene in `out`, which appears when it is whole.
///
/// The scene is read for the box of its means, and its parts then go into a GaussianSorter. Parts
/// that do not fit into `memory_bytes` are read a second time for that. Leaves follow from the
/// sorted stream, and every page is made as soon as its children are, in parallel. So memory does
/// not grow with the scene: `memory_bytes` for sorting, a part, and about 200 MB. What does not fit
/// is sorted in a file beside `out`, of as many bytes as the scene has in memory.
/// The bytes of `out` depend on the scene alone, not on threads or memory.
///
/// Throws InputError: no Gaussians, more than TreeShape::max_gaussians, or no space on the disk.
TreeHeader build_tree(const SceneParts& scene, const std::filesystem::path& out,
                      std::size_t memory_bytes, ThreadPool& pool, const LoadContext& context);

}  // namespace catgs
