#include "render_core/cpu/depth_sampler.h"

#include <algorithm>

namespace catgs {
namespace {

/// Parts [begin, end) of one axis.
struct Range {
  int begin, end;
};

/// Those of a cell. Parts whose middle lies beyond the picture's edge know too few pixels.
Range parts_of_cell(int cell, int cells, int size_px) {
  constexpr int half_px = part_side_px / 2;
  const int known = std::max((size_px - half_px + part_side_px - 1) / part_side_px, 1);
  // The first part whose middle is not left of `edge` / cells, px.
  const auto first_from = [&](int edge) {
    const int beyond = edge - half_px * cells;
    return beyond <= 0 ? 0 : (beyond + part_side_px * cells - 1) / (part_side_px * cells);
  };
  const int begin = first_from(cell * size_px);
  const int end = std::min(first_from((cell + 1) * size_px), known);
  if (begin < end) return {begin, end};
  const int around = std::min((2 * cell + 1) * size_px / (2 * cells * part_side_px), known - 1);
  return {around, around + 1};
}

}  // namespace

void DepthSampler::begin(glm::ivec2 size_px, glm::ivec2 cells) {
  size_px_ = size_px;
  cells_ = cells;
  if (cells == glm::ivec2(0)) return;
  const glm::ivec2 tiles = (size_px + (tile_size_px - 1)) / tile_size_px;
  stride_ = tiles.x * parts_across;
  parts_.assign(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(tiles.y) *
                    static_cast<std::size_t>(parts_across),
                0.0f);
  inverse_depths_.resize(static_cast<std::size_t>(cells.x) * static_cast<std::size_t>(cells.y));
}

PartEnds DepthSampler::of_tile(glm::ivec2 tile) {
  if (cells_ == glm::ivec2(0)) return {};
  return {parts_.data() + (tile.y * stride_ + tile.x) * parts_across, stride_};
}

DepthGrid DepthSampler::finish(ThreadPool& pool) {
  if (cells_ == glm::ivec2(0)) return {};
  pool.parallel_for(static_cast<std::size_t>(cells_.y),
                    [&](std::size_t row) { find_row(static_cast<int>(row)); });
  return {cells_, inverse_depths_};
}

void DepthSampler::find_row(int row) {
  const Range rows = parts_of_cell(row, cells_.y, size_px_.y);
  std::vector<float> found;
  for (int column = 0; column < cells_.x; ++column) {
    const Range columns = parts_of_cell(column, cells_.x, size_px_.x);
    found.clear();
    for (int y = rows.begin; y < rows.end; ++y) {
      const float* const line = parts_.data() + y * stride_;
      found.insert(found.end(), line + columns.begin, line + columns.end);
    }
    if (found.empty()) continue;  // no cell is without parts
    const auto middle = found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2);
    std::ranges::nth_element(found, middle);
    inverse_depths_[static_cast<std::size_t>(row * cells_.x + column)] = *middle;
  }
}

}  // namespace catgs
