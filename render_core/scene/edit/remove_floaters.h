#pragma once

#include <cstddef>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Removes the Gaussians that belong to no surface; returns how many. The others keep their order.
///
/// A grid of 256^3 cells holds all of space. Its middle 128^3 are a cube around the robust bounds.
/// Beyond, cells grow with the distance (the contraction of Mip-NeRF 360, Barron et al. 2022, with
/// the largest coordinate as the norm), so that backgrounds far away are judged coarsely. Each
/// Gaussian is spread over the cells that it crosses. A cell is occupied if all Gaussians in it
/// stop 5 % of a ray's light.
///
/// Occupied cells that touch, at a face, edge or corner, form a group. A group is a surface if it
/// has at least a thousandth of the cells of the largest group. A Gaussian stays if it crosses a
/// cell of a surface or a neighbour of one, or if it is large itself: wider than 16 half cells from
/// -1.5 to 1.5 standard deviations. So the largest group always stays. If no cell is occupied,
/// nothing is removed.
///
/// Takes about 200 MB, and a byte per Gaussian. The result does not depend on threads.
std::size_t remove_floaters(GaussianCloud& cloud, ThreadPool& pool);

}  // namespace catgs
