#include "render_core/walk/occupancy.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/gtc/quaternion.hpp>

#include "render_core/base/error.h"

namespace catgs::walk {
namespace {

constexpr float solid = 0.3f;  // optical depth: a quarter of the light is stopped
constexpr float reach = 1.5f;  // standard deviations
constexpr int most_points = 256;

/// Points along one axis of a Gaussian and their weights, whose sum is 1.
struct Comb {
  int points;
  float total = 0.0f;

  /// `sigma`: cells.
  Comb(float sigma, int most) {
    points = static_cast<int>(
        std::clamp(std::ceil(2.0f * reach * sigma), 1.0f, static_cast<float>(most)));
    for (int k = 0; k < points; ++k) total += density(k);
  }
  [[nodiscard]] float position(int k) const {  // standard deviations
    return reach * (static_cast<float>(2 * k + 1) / static_cast<float>(points) - 1.0f);
  }
  [[nodiscard]] float weight(int k) const { return density(k) / total; }

 private:
  [[nodiscard]] float density(int k) const { return std::exp(-0.5f * position(k) * position(k)); }
};

}  // namespace

bool Occupancy::share_of(const glm::vec3& position, float depth, Shares& to) const {
  if (!(position.x >= 0.0f && position.y >= 0.0f && position.z >= 0.0f && position.x < grid_side &&
        position.y < grid_side && position.z < grid_levels))
    return false;
  const glm::ivec3 cell(position), block = cell / block_side, in = cell % block_side;
  const auto column = static_cast<std::uint32_t>(block.y * blocks + block.x);
  to[(column ^ column >> 7) % shards].push_back(
      {column, static_cast<std::uint16_t>(block.z),
       static_cast<std::uint16_t>((in.y * block_side + in.x) * block_side + in.z), depth,
       depth * (position.z - static_cast<float>(cell.z))});
  return true;
}

/// Returns how many shares there were.
std::size_t Occupancy::spread(const GaussianCloud& part, std::size_t i, Shares& to) const {
  const glm::vec3 scale = part.scale[i] / grid_.cell;
  const glm::vec3 mean = grid_.from_world(part.mean[i]);
  const float radius = reach * std::max({scale.x, scale.y, scale.z});
  const glm::vec3 end(grid_side, grid_side, grid_levels);
  for (int k = 0; k < 3; ++k)
    if (!(mean[k] > -radius && mean[k] < end[k] + radius)) return 0;
  std::array<int, 3> axes = {0, 1, 2};
  std::ranges::sort(axes, [&](int a, int b) { return scale[a] > scale[b]; });
  const float area = part.opacity[i] * 6.2831853f * scale[axes[0]] * scale[axes[1]];
  const Comb u(scale[axes[0]], most_points), v(scale[axes[1]], most_points);
  const Comb w(scale[axes[2]], std::max(1, most_points * most_points / (u.points * v.points)));
  if (u.points * v.points * w.points == 1) return share_of(mean, area, to) ? 1 : 0;
  glm::mat3 step = glm::transpose(grid_.axes) * glm::mat3_cast(part.rotation[i]);
  for (int k = 0; k < 3; ++k) step[k] *= scale[k];
  std::size_t count = 0;
  for (int a = 0; a < u.points; ++a)
    for (int b = 0; b < v.points; ++b) {
      const glm::vec3 middle = mean + step[axes[0]] * u.position(a) + step[axes[1]] * v.position(b);
      const float depth = area * u.weight(a) * v.weight(b);
      for (int c = 0; c < w.points; ++c)
        count += share_of(middle + step[axes[2]] * w.position(c), depth * w.weight(c), to) ? 1 : 0;
    }
  return count;
}

void Occupancy::take(const std::vector<Share>& from, std::size_t& blocks_taken) {
  for (const Share& share : from) {
    std::vector<Block>& column = columns_[share.column];
    auto block = std::ranges::lower_bound(column, share.level, {}, &Block::level);
    if (block == column.end() || block->level != share.level) {
      if (++blocks_taken > most_blocks_of_shard_) return;
      const auto at = block - column.begin();
      if (column.size() == column.capacity()) column.reserve(column.size() + column.size() / 4 + 1);
      block = column.insert(column.begin() + at, Block{share.level});
    }
    Cell& cell = block->cells[share.cell];
    cell.depth += share.depth;
    cell.height += share.height;
  }
}

void Occupancy::add_solid(const glm::ivec2& column, float height) {
  Shares shares;
  const glm::vec3 position(glm::vec2(column) + 0.5f, height);
  if (!share_of(position, solid, shares)) return;
  for (std::size_t shard = 0; shard < Occupancy::shards; ++shard)
    take(shares[shard], blocks_of_shard_[shard]);
}

/// Chunks of the part spread their Gaussians side by side. Then each shard, which has columns of
/// its own, takes the shares in the order of the chunks.
void Occupancy::add(const GaussianCloud& part, ThreadPool& pool,
                    const std::function<void()>& progress) {
  constexpr std::size_t chunk_count = 32, most_shares = std::size_t{1} << 17;
  struct Chunk {
    std::size_t next, end;
    Shares shares;
  };
  std::vector<Chunk> chunks(chunk_count);
  for (std::size_t k = 0; k < chunk_count; ++k) {
    chunks[k].next = part.size() * k / chunk_count;
    chunks[k].end = part.size() * (k + 1) / chunk_count;
  }
  while (std::ranges::any_of(chunks, [](const Chunk& c) { return c.next < c.end; })) {
    pool.parallel_for(chunk_count, [&](std::size_t k) {
      progress();
      Chunk& chunk = chunks[k];
      for (auto& shares : chunk.shares) shares.clear();
      for (std::size_t count = 0; chunk.next < chunk.end && count < most_shares; ++chunk.next)
        count += spread(part, chunk.next, chunk.shares);
    });
    pool.parallel_for(shards, [&](std::size_t shard) {
      progress();
      for (const Chunk& chunk : chunks) take(chunk.shares[shard], blocks_of_shard_[shard]);
    });
    if (std::ranges::max(blocks_of_shard_) > most_blocks_of_shard_)
      throw InputError("the scene", "", "fills too many cells to find its walkable area",
                       "with a larger --eye-height, cells are larger");
  }
}

Occupancy::Rect Occupancy::extent() const {
  Rect rect{glm::ivec2(grid_side), glm::ivec2(0)};
  for (int y = 0; y < blocks; ++y)
    for (int x = 0; x < blocks; ++x) {
      if (columns_[static_cast<std::size_t>(y * blocks + x)].empty()) continue;
      rect.min = glm::min(rect.min, block_side * glm::ivec2(x, y));
      rect.max = glm::max(rect.max, block_side * glm::ivec2(x + 1, y + 1));
    }
  return rect.max.x > 0 ? rect : Rect{};
}

void Occupancy::append_runs(const glm::ivec2& column, std::vector<Run>& runs) const {
  const glm::ivec2 block = column / block_side, in = column % block_side;
  const std::size_t first = runs.size();
  const auto first_cell = static_cast<std::size_t>((in.y * block_side + in.x) * block_side);
  for (const Block& b : columns_[static_cast<std::size_t>(block.y * blocks + block.x)])
    for (std::size_t k = 0; k < block_side; ++k) {
      const Cell& cell = b.cells[first_cell + k];
      if (cell.depth < solid) continue;
      const auto level = static_cast<std::int16_t>(b.level * block_side + static_cast<int>(k));
      const float top = static_cast<float>(level) + cell.height / cell.depth;
      if (runs.size() > first && runs.back().high == level)
        runs.back() = {runs.back().low, static_cast<std::int16_t>(level + 1), top};
      else
        runs.push_back({level, static_cast<std::int16_t>(level + 1), top});
    }
}

std::size_t Occupancy::bytes() const {
  std::size_t bytes = columns_.size() * sizeof(columns_[0]);
  for (const auto& column : columns_) bytes += column.capacity() * sizeof(Block);
  return bytes;
}

}  // namespace catgs::walk
