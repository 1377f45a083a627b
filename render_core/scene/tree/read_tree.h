#pragma once

#include <memory>
#include <string>
#include <vector>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/tree/cut.h"
#include "render_core/scene/tree/tree_file.h"

namespace catgs {

struct SceneFormat;

/// Throws InputError if the root's page is damaged or missing: nothing can be seen without it.
void require_root(const TreeFile& tree);

/// The Gaussians of nodes, in their order, as packed. Rotations and scales are the axes of the
/// packed covariances. Throws InputError if a page is damaged.
GaussianCloud read_nodes(TreeFile& tree, std::span<const NodeId> nodes, const LoadContext& context);

/// A tree as a scene: all its leaves. Where pages are damaged or missing, the finest nodes that
/// stand for their leaves are taken, and a note says so. Throws InputError when the header is
/// wrong, no page is left, or there are more than max_gaussians.
struct TreeScene {
  GaussianCloud cloud;
  std::vector<std::string> notes;  // for people
  glm::dvec3 origin{0.0};          // that the cloud is about
};
TreeScene read_tree(std::unique_ptr<const ByteSource> file, const LoadContext& context);

/// An outline has so many at most.
inline constexpr std::uint64_t outline_gaussians = 1'000'000;

/// The same for the finest level with at most `most_gaussians` that ends a page, or that of the
/// root's page: an outline of a scene of any size.
TreeScene read_tree(TreeFile& tree, std::uint64_t most_gaussians, const LoadContext& context);

extern const SceneFormat tree_format;

}  // namespace catgs
