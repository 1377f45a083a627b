#pragma once

namespace catgs::first_sight {

/// The picture that first views are judged by: 16:9, 60 degrees high, as pages open it.
inline constexpr int width_px = 192, height_px = 108;
inline constexpr float half_height = 0.57735027f;  // tan(fov_y / 2)
inline constexpr float half_width = half_height * width_px / height_px;

}  // namespace catgs::first_sight
