#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/walk/grid.h"

namespace catgs::walk {

/// Cells of a column that are solid one above the other, in cells.
struct Run {
  std::int16_t low, high;  // the first one, and the first one above it that is not solid
  float top;               // the mean height of what the last one holds
};

/// Where the scene stops light, in the cells of a grid. Only blocks of 4 x 4 x 4 cells that some
/// Gaussian meets take memory: 516 bytes each, and up to a quarter more for growth. Gaussians
/// beyond the grid are ignored.
class Occupancy {
 public:
  explicit Occupancy(const Grid& grid, std::size_t most_blocks = std::size_t{1} << 24)
      : grid_(grid),
        most_blocks_of_shard_(most_blocks / shards),
        columns_(std::size_t{blocks} * blocks) {}

  [[nodiscard]] const Grid& grid() const { return grid_; }

  /// Adds the optical depth of Gaussians to the cells that they meet. Each Gaussian stops
  /// opacity * 2 pi s t of the light, its integral over the plane of its two larger standard
  /// deviations (as VoxelGrid has it). That is spread over points up to 1.5 standard
  /// deviations away, a cell apart, but no more than 2^16 of them. The result depends on the order
  /// of the Gaussians and not on the threads. Takes up to 100 MB while it runs. Throws InputError
  /// where a sixteenth of the columns meets more than a sixteenth of the most blocks. `progress` is
  /// called often, by several threads at a time, and may throw to end it.
  void add(
      const GaussianCloud& part, ThreadPool& pool, const std::function<void()>& progress = [] {});

  /// Makes the cell of the column (east, north) at this height solid up to there. Cells.
  void add_solid(const glm::ivec2& column, float height);

  struct Rect {
    glm::ivec2 min{0}, max{0};  // cells; `max` is beyond the last one
  };
  /// The columns that may hold solid cells.
  [[nodiscard]] Rect extent() const;

  /// The runs of the column (east, north), from below, appended to `runs`.
  void append_runs(const glm::ivec2& column, std::vector<Run>& runs) const;

  [[nodiscard]] std::size_t bytes() const;

 private:
  static constexpr int block_side = 4, blocks = grid_side / block_side;
  static constexpr std::size_t shards = 16;
  struct Cell {
    float depth = 0.0f;   // optical depth for a ray through the cell
    float height = 0.0f;  // sum of depth times height in the cell, 0…1
  };
  struct Block {
    int level;  // of its lowest cell / block_side
    std::array<Cell, block_side * block_side * block_side> cells{};
  };
  /// A share of a Gaussian that lies in a cell.
  struct Share {
    std::uint32_t column;  // index in columns_
    std::uint16_t level;   // as Block::level
    std::uint16_t cell;    // index in Block::cells
    float depth, height;
  };
  using Shares = std::array<std::vector<Share>, shards>;

  std::size_t spread(const GaussianCloud& part, std::size_t i, Shares& to) const;
  bool share_of(const glm::vec3& position, float depth, Shares& to) const;
  void take(const std::vector<Share>& from, std::size_t& blocks_taken);

  Grid grid_;
  std::size_t most_blocks_of_shard_;
  std::array<std::size_t, shards> blocks_of_shard_{};
  std::vector<std::vector<Block>> columns_;  // by north * blocks + east; each sorted by level
};

}  // namespace catgs::walk
