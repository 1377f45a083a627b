#include "render_core/cpu/occlusion.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <glm/common.hpp>

#include "render_core/cpu/kernels.h"
#include "render_core/math/occlusion-inl.h"

namespace catgs {
namespace {

std::size_t area(glm::ivec2 size) {
  return static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y);
}

math::CameraModel<float> model_of(const Camera& camera) {
  return math::convert<float>(math::make_camera_model(camera));
}

}  // namespace

void Occlusion::begin(const Camera& camera, float mean_inverse_depth, const SimdKernels& kernels,
                      ThreadPool& pool) {
  if (camera.size_px != now_.size_px) last_.reset();
  now_ = camera;
  model_ = model_of(camera);
  parts_ = (camera.size_px + (part_side_px - 1)) / part_side_px;
  room_ = (camera.size_px + (tile_size_px - 1)) / tile_size_px * parts_across;
  ends_.resize(area(room_));
  limited_ = false;
  if (!last_) return;
  const int radius =
      math::occlusion_radius(model_, model_of(*last_), mean_inverse_depth, part_side_px);
  if (radius < 0) return;
  spread_ends(radius, pool);
  find_limits(kernels, pool);
  limited_ = true;
}

/// Sets deepest_ to the deepest end of the parts up to `radius` around each part.
void Occlusion::spread_ends(int radius, ThreadPool& pool) {
  deepest_in_row_.assign(ends_.size(), 0.0f);
  deepest_.assign(ends_.size(), 0.0f);
  // The deepest of `from` and of `to`, for a run of parts.
  const auto raise = [](const float* from, int count, float* to) {
    for (int i = 0; i < count; ++i) to[i] = std::max(to[i], from[i]);
  };
  const auto rows = static_cast<std::size_t>(parts_.y), stride = static_cast<std::size_t>(room_.x);
  pool.parallel_for(rows, [&](std::size_t y) {
    const float* const from = ends_.data() + y * stride;
    float* const to = deepest_in_row_.data() + y * stride;
    for (int k = 0; k <= std::min(radius, parts_.x - 1); ++k) {
      raise(from + k, parts_.x - k, to);
      raise(from, parts_.x - k, to + k);
    }
  });
  pool.parallel_for(rows, [&](std::size_t y) {
    const int low = std::max(static_cast<int>(y) - radius, 0);
    const int high = std::min(static_cast<int>(y) + radius, parts_.y - 1);
    for (int row = low; row <= high; ++row)
      raise(deepest_in_row_.data() + row * room_.x, parts_.x, deepest_.data() + y * stride);
  });
}

void Occlusion::find_limits(const SimdKernels& kernels, ThreadPool& pool) {
  const auto longest = static_cast<unsigned>(std::max(parts_.x, parts_.y));
  const int levels =
      std::max(static_cast<int>(std::bit_width(longest)), DepthLimits::tile_level) + 1;
  limits_.resize(ends_.size() * static_cast<std::size_t>(levels * DepthLimits::spreads));
  pool.parallel_for(static_cast<std::size_t>(parts_.y), [&](std::size_t y) {
    kernels.find_limits({&now_, &*last_, deepest_.data(), room_.x, parts_, static_cast<int>(y),
                         limits_.data() + y * static_cast<std::size_t>(room_.x)});
  });
  levels_ = levels;
  spread_limits(0, parts_);
  glm::ivec2 size = parts_;
  for (int level = 1; level < levels; ++level) {
    const float* const finer = limits_.data() + static_cast<std::size_t>(level - 1) * ends_.size();
    float* const cells = limits_.data() + static_cast<std::size_t>(level) * ends_.size();
    const glm::ivec2 last_finer = size - 1;
    size = (size + 1) / 2;
    for (int y = 0; y < size.y; ++y) {
      const float* const upper = finer + 2 * y * room_.x;
      const float* const lower = finer + std::min(2 * y + 1, last_finer.y) * room_.x;
      for (int x = 0; x < size.x; ++x) {
        const int left = 2 * x, right = std::min(2 * x + 1, last_finer.x);
        cells[y * room_.x + x] =
            std::max(std::max(upper[left], upper[right]), std::max(lower[left], lower[right]));
      }
    }
    spread_limits(level, size);
  }
}

/// Fills the other pyramids' cells of a level of `size` cells.
void Occlusion::spread_limits(int level, glm::ivec2 size) {
  const std::size_t pyramid = static_cast<std::size_t>(levels_) * ends_.size();
  float* const first = limits_.data() + static_cast<std::size_t>(level) * ends_.size();
  for (int y = 0; y < size.y; ++y) {
    const float* const row = first + y * room_.x;
    const float* const below = first + std::min(y + 1, size.y - 1) * room_.x;
    float* const to = first + y * room_.x;
    for (int x = 0; x < size.x; ++x) {
      const int next = std::min(x + 1, size.x - 1);
      const float across = std::max(row[x], row[next]);
      to[pyramid * DepthLimits::right + x] = across;
      to[pyramid * DepthLimits::below + x] = std::max(row[x], below[x]);
      to[pyramid * DepthLimits::both + x] = std::max(across, std::max(below[x], below[next]));
    }
  }
}

DepthLimits Occlusion::limits() const {
  if (!limited_) return {};
  return {limits_.data(), room_.x, room_.y, levels_};
}

PartEnds Occlusion::ends_of_tile(glm::ivec2 tile) {
  return {ends_.data() + parts_across * (tile.y * room_.x + tile.x), room_.x};
}

bool Occlusion::hides(const Cluster& cluster) const {
  if (!limited_) return false;
  const glm::vec3 &c = cluster.centre, &h = cluster.half_extent;
  const auto box =
      math::cluster_box<float>(model_, {c.x, c.y, c.z}, {h.x, h.y, h.z}, cluster.reach);
  if (!(box.nearest > 0.0f)) return false;
  const glm::vec2 last(now_.size_px - 1), per_part(1.0f / part_side_px);
  const glm::ivec2 low(glm::clamp(glm::vec2(box.low_px.x, box.low_px.y), glm::vec2(0.0f), last) *
                       per_part);
  const glm::ivec2 high(glm::clamp(glm::vec2(box.high_px.x, box.high_px.y), glm::vec2(0.0f), last) *
                        per_part);
  // At most 9x9 cells.
  const int span = std::max(high.x - low.x, high.y - low.y);
  const int level = std::max(0, static_cast<int>(std::bit_width(static_cast<unsigned>(span))) - 3);
  const DepthLimits limits = this->limits();
  for (int row = low.y >> level; row <= high.y >> level; ++row)
    for (int column = low.x >> level; column <= high.x >> level; ++column)
      if (!(box.nearest > limits.at(level, column, row))) return false;
  return true;
}

std::size_t Occlusion::memory_bytes() const {
  std::size_t floats = 0;
  for (const auto* buffer : {&ends_, &deepest_in_row_, &deepest_, &limits_})
    floats += buffer->capacity();
  return floats * sizeof(float);
}

}  // namespace catgs
