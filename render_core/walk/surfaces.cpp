#include "render_core/walk/surfaces.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

namespace catgs::walk {

template <class Body>
void Surfaces::for_all(ThreadPool& pool, const Body& body) const {
  constexpr std::size_t block = 16384;
  pool.parallel_for((count() + block - 1) / block, [&](std::size_t b) {
    progress_();
    for (std::size_t i = b * block; i < std::min(count(), (b + 1) * block); ++i) body(i);
  });
}

Surfaces::Surfaces(const Occupancy& occupancy, const Person& person, ThreadPool& pool,
                   std::function<void()> progress)
    : person_(person),
      progress_(std::move(progress)),
      extent_(occupancy.extent()),
      width_(extent_.max.x - extent_.min.x) {
  read_runs(occupancy, pool);
  open_.resize(count());
  height_.resize(count());
  for_all(pool, [&](std::size_t i) {
    height_[i] = runs_[i].top;
    open_[i] = ceiling(i) - height_[i] >= Person::in_cells(person_.height);
  });
  smooth(pool);
  drop_steep(pool);
}

void Surfaces::read_runs(const Occupancy& occupancy, ThreadPool& pool) {
  const auto rows = static_cast<std::size_t>(extent_.max.y - extent_.min.y);
  const auto columns = static_cast<std::size_t>(width_);
  std::vector<std::vector<Run>> of_row(rows);
  first_.resize(rows * columns + 1);
  pool.parallel_for(rows, [&](std::size_t row) {
    progress_();
    for (std::size_t x = 0; x < columns; ++x) {
      const std::size_t before = of_row[row].size();
      occupancy.append_runs(extent_.min + glm::ivec2(x, row), of_row[row]);
      first_[row * columns + x + 1] = static_cast<std::uint32_t>(of_row[row].size() - before);
    }
  });
  for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
  runs_.resize(first_.back());
  column_.resize(first_.back());
  pool.parallel_for(rows, [&](std::size_t row) {
    std::ranges::copy(of_row[row], runs_.begin() + first_[row * columns]);
    for (std::size_t c = row * columns; c < (row + 1) * columns; ++c)
      std::fill(column_.begin() + first_[c], column_.begin() + first_[c + 1],
                static_cast<std::uint32_t>(c));
  });
}

glm::ivec2 Surfaces::column_of(std::size_t i) const {
  const int column = static_cast<int>(column_[i]);
  return extent_.min + glm::ivec2(column % width_, column / width_);
}

std::span<const Run> Surfaces::runs_at(const glm::ivec2& column) const {
  const glm::ivec2 at = column - extent_.min;
  if (at.x < 0 || at.y < 0 || column.x >= extent_.max.x || column.y >= extent_.max.y) return {};
  const auto c = static_cast<std::size_t>(at.y) * static_cast<std::size_t>(width_) +
                 static_cast<std::size_t>(at.x);
  return std::span(runs_).subspan(first_[c], first_[c + 1] - first_[c]);
}

float Surfaces::ceiling(std::size_t i) const {
  if (i + 1 == count() || column_[i + 1] != column_[i]) return std::numeric_limits<float>::max();
  return runs_[i + 1].low;
}

std::uint32_t Surfaces::next(std::size_t i, int direction) const {
  const std::span<const Run> column = runs_at(column_of(i) + directions[direction]);
  if (column.empty()) return none;
  const auto begin = static_cast<std::size_t>(column.data() - runs_.data());
  for (std::size_t k = begin; k < begin + column.size(); ++k) {
    if (!open_[k] || std::abs(height_[k] - height_[i]) > Person::in_cells(person_.step)) continue;
    const float room = std::min(ceiling(i), ceiling(k)) - std::max(height_[i], height_[k]);
    if (room >= Person::in_cells(person_.height)) return static_cast<std::uint32_t>(k);
  }
  return none;
}

/// Two rounds of a mean with the neighbours. The centre counts as two of them.
void Surfaces::smooth(ThreadPool& pool) {
  std::vector<float> smoothed(count());
  for (int round = 0; round < 2; ++round) {
    for_all(pool, [&](std::size_t i) {
      float sum = 2.0f * height_[i], weight = 2.0f;
      for (int d = 0; open_[i] && d < 4; ++d)
        if (const std::uint32_t k = next(i, d); k != none) {
          sum += height_[k];
          weight += 1.0f;
        }
      smoothed[i] = sum / weight;
    });
    height_.swap(smoothed);
  }
}

/// The slope is measured over up to four cells, so that a single step is none.
void Surfaces::drop_steep(ThreadPool& pool) {
  std::vector<char> flat(count());
  for_all(pool, [&](std::size_t i) {
    if (!open_[i]) return;
    float rise[2], run[2];
    for (int axis = 0; axis < 2; ++axis) {
      std::size_t end[2] = {i, i};
      run[axis] = 0.0f;
      for (int side = 0; side < 2; ++side)
        for (int k = 0; k < 2; ++k) {
          const std::uint32_t beyond = next(end[side], axis + 2 * side);
          if (beyond == none) break;
          end[side] = beyond;
          run[axis] += 1.0f;
        }
      rise[axis] = height_[end[0]] - height_[end[1]];
    }
    const float x = run[0] > 0.0f ? rise[0] / run[0] : 0.0f;
    const float y = run[1] > 0.0f ? rise[1] / run[1] : 0.0f;
    flat[i] = x * x + y * y <= person_.slope * person_.slope;
  });
  open_.swap(flat);
}

/// Each round takes away what lacks a neighbour. Rounds of four and of eight neighbours take turns,
/// which makes an octagon, the shape nearest to a circle that neighbours can make.
std::vector<char> Surfaces::with_room(ThreadPool& pool) const {
  std::vector<char> alive = open_, left(count());
  const int rounds = static_cast<int>(Person::in_cells(person_.radius));
  for (int round = 0; round < rounds; ++round) {
    for_all(pool, [&](std::size_t i) {
      const auto lives = [&](std::uint32_t k) { return k != none && alive[k] != 0; };
      bool all = alive[i] != 0;
      for (int d = 0; d < 4 && all; ++d) {
        const std::uint32_t beside = next(i, d);
        all = lives(beside) && (round % 2 == 0 || lives(next(beside, (d + 1) % 4)));
      }
      left[i] = all;
    });
    alive.swap(left);
  }
  return alive;
}

}  // namespace catgs::walk
