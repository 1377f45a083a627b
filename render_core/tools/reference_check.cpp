#include "render_core/tools/reference_check.h"

#include "render_core/reference/reference.h"

namespace catgs {

double reference_error(const RenderSetup& setup, std::size_t i, const FrameView& frame,
                       std::size_t count) {
  const auto pixels = random_pixels(frame.size_px, count, setup.first + i);
  const auto truth = render_reference_pixels(setup.whole_cloud("--pixels, --quality of exact"),
                                             setup.request(i), pixels, *setup.pool);
  double sum = 0.0;
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    const auto* row = reinterpret_cast<const float*>(frame.planes[0].data +
                                                     frame.planes[0].stride_bytes *
                                                         static_cast<std::size_t>(pixels[k].y));
    for (int c = 0; c < 3; ++c) {
      const double error = static_cast<double>(row[pixels[k].x * 3 + c]) - truth[k][c];
      sum += error * error;
    }
  }
  return sum / static_cast<double>(3 * pixels.size());
}

}  // namespace catgs
