#pragma once

#include <cstddef>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/depth_limits.h"
#include "render_core/frame/depth_grid.h"

namespace catgs {

/// Makes the depth grid of a frame from what its parts show.
class DepthSampler {
 public:
  /// Starts a frame. `cells`: 0: no grid.
  void begin(glm::ivec2 size_px, glm::ivec2 cells);
  /// Where a tile's blend notes the inverse depths of its parts.
  [[nodiscard]] PartEnds of_tile(glm::ivec2 tile);
  /// The grid of the frame, valid until the next begin(). A cell has the median of the parts whose
  /// middles lie in it; a cell without any has the part around its own middle.
  [[nodiscard]] DepthGrid finish(ThreadPool& pool);

  [[nodiscard]] std::size_t memory_bytes() const {
    return (parts_.capacity() + inverse_depths_.capacity()) * sizeof(float);
  }

 private:
  void find_row(int row);

  glm::ivec2 size_px_{0}, cells_{0};
  int stride_ = 0;  // of parts_
  std::vector<float> parts_;
  std::vector<float> inverse_depths_;  // [row][column] of cells
};

}  // namespace catgs
