#pragma once

#include <functional>

#include "render_core/base/thread_pool.h"
#include "render_core/frame/renderer.h"
#include "render_core/image/image.h"

namespace catgs {

/// The pose at the same place and of the same direction, upright. `up` is unit.
Pose levelled(const Pose& pose, const glm::vec3& up);

/// Draws all that surrounds the camera of `request` as an equirectangular picture. The middle shows
/// where the camera looks, the upper edge is above its picture, and longitudes grow to the right.
/// Only pose and near plane of the camera count. `size_px` is 2:1. `draw` renders a request and
/// may throw.
///
/// Six pictures are drawn, one along each axis of the camera. They are wider than a right angle and
/// fade into each other where they overlap. A splat is a projection that holds near its centre only
/// (EWA), so pictures side by side would show seams.
/// `after_row` is called seven times for each row of the picture, by threads of the pool, and may
/// throw to cancel.
Image draw_panorama(
    const FrameRequest& request, glm::ivec2 size_px, ThreadPool& pool,
    const std::function<Image(const FrameRequest&)>& draw,
    const std::function<void()>& after_row = [] {});

}  // namespace catgs
