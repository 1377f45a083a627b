#pragma once

#include <cstddef>
#include <span>

#include "render_core/scene/tree/tree_shape.h"

namespace catgs {

/// A node's facts and its packed block.
struct NodeView {
  const NodeFacts& facts;
  std::span<const std::byte> block;
};

/// Makes the node that stands for one or two others, at most cluster_size Gaussians: packs them
/// into `block`, which is zeros, and returns the node's facts. The result depends on the arguments
/// alone. A node with a single child is its copy.
///
/// The Gaussians of both children are grouped until cluster_size groups are left, each time the two
/// groups that are cheapest to join. The cost of a pair, in world units squared, is
///
///   |mean_a - mean_b|^2 + (size_a - size_b)^2 + (colour_reach |colour_a - colour_b|)^2
///
/// with size = sqrt(tr Sigma / 3) and colour_reach = 12 x the children's mean size (sizes over
/// their 0.98 quantile count as that). A group becomes
/// one Gaussian by moment matching with the weights w = o A: opacity x RMS projected area. With
/// W = sum w,
///
///   mean = sum w mean_i / W,    SH = sum w SH_i / W,
///   Sigma = sum w (Sigma_i + d_i d_i^T) / W,    d_i = mean_i - mean,
///   opacity = W / A(Sigma): the projected area is kept. Where that is more than 1, Sigma grows by
///   as much, but no more than 1.5 times.
///
/// A(Sigma) = sqrt(tr(adj Sigma) / 3) is the root of the mean of det over the projections of Sigma
/// onto planes of all directions n, since that determinant is n^T adj(Sigma) n. A group of one
/// keeps its Gaussian's record, up to the units of the cluster.
///
/// The node's error is the 0.9 quantile over its Gaussians of their RMS displacement,
/// sqrt(sum w |d_i|^2 / W), plus the larger error of its children. So it never falls towards the
/// root.
NodeFacts merge_nodes(std::span<const NodeView> children, int sh_degree,
                      std::span<std::byte> block);

}  // namespace catgs
