#include "render_core/cpu/tile_reach.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <utility>

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include "render_core/math/constants.h"
#include "render_core/math/homography-inl.h"

namespace catgs {
namespace {

// Margin for a camera that comes nearer, and for surfaces that appear behind others, from one frame
// to the next.
constexpr float reserve = 1.05f;

std::size_t count(glm::ivec2 tiles) {
  return static_cast<std::size_t>(tiles.x) * static_cast<std::size_t>(tiles.y);
}

}  // namespace

void TileReach::begin(const FramePlan& plan) {
  if (plan.kind == FrameKind::key) {
    const glm::ivec2 tiles = plan.grid.tiles;
    reach_.assign(count(tiles), unknown);
    if (last_.size() == count(plan_.grid.tiles)) {
      for (int y = 0; y < tiles.y; ++y) {
        for (int x = 0; x < tiles.x; ++x) {
          const glm::vec2 middle = glm::vec2(plan.grid.first_px) +
                                   (glm::vec2(x, y) + 0.5f) * static_cast<float>(tile_size_px);
          const auto at =
              math::apply<float>(math::convert<float>(plan_.list_from_frame), {middle.x, middle.y});
          const glm::vec2 tile = (glm::vec2(at.x, at.y) - glm::vec2(plan_.grid.first_px)) /
                                 static_cast<float>(tile_size_px);
          reach_[static_cast<std::size_t>(y * tiles.x + x)] =
              last_around(glm::ivec2(glm::floor(tile)));
        }
      }
    }
  }
  if (plan.kind == FrameKind::key) last_ = reach_;
  plan_ = plan;
}

/// The largest reach among a tile and its neighbours.
std::uint32_t TileReach::last_around(glm::ivec2 tile) const {
  const glm::ivec2 tiles = plan_.grid.tiles;
  const glm::ivec2 low = glm::max(tile - 1, 0), end = glm::min(tile + 2, tiles);
  if (glm::any(glm::greaterThanEqual(low, end))) return unknown;
  std::uint32_t farthest = 0;
  for (int y = low.y; y < end.y; ++y)
    for (int x = low.x; x < end.x; ++x)
      farthest = std::max(farthest, last_[static_cast<std::size_t>(y * tiles.x + x)]);
  return farthest;
}

void TileReach::set(std::size_t tile, std::uint32_t depth_bits) {
  assert(tile < reach_.size());
  if (depth_bits == unknown) {
    reach_[tile] = last_[tile] = unknown;
  } else {
    last_[tile] = std::bit_cast<std::uint32_t>(reserve * std::bit_cast<float>(depth_bits));
  }
}

}  // namespace catgs
