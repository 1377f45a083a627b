#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/walk/occupancy.h"

namespace catgs::walk {

/// The tops of all runs of an occupancy, and how they are connected.
class Surfaces {
 public:
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  static constexpr glm::ivec2 directions[4] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};

  /// Here and in with_room(), `progress` is called often, by several threads at a time, and may
  /// throw to end it.
  Surfaces(const Occupancy& occupancy, const Person& person, ThreadPool& pool,
           std::function<void()> progress);

  [[nodiscard]] std::size_t count() const { return runs_.size(); }
  [[nodiscard]] const Occupancy::Rect& extent() const { return extent_; }
  /// The column of surface i, in cells of the grid.
  [[nodiscard]] glm::ivec2 column_of(std::size_t i) const;
  /// Height of surface i, smoothed over its neighbours, cells.
  [[nodiscard]] float height(std::size_t i) const { return height_[i]; }
  /// Whether a body has room above surface i and can stand on it.
  [[nodiscard]] bool open(std::size_t i) const { return open_[i] != 0; }
  /// The surface that one step from i in a direction leads to; `none` where none does.
  [[nodiscard]] std::uint32_t next(std::size_t i, int direction) const;
  /// The runs of a column of the grid, from below, and the surface of the first one.
  [[nodiscard]] std::span<const Run> runs_at(const glm::ivec2& column) const;
  [[nodiscard]] std::size_t first_at(const glm::ivec2& column) const {
    return static_cast<std::size_t>(runs_at(column).data() - runs_.data());
  }
  /// Marks the open surfaces that are connected all around within the body's
  /// radius.
  [[nodiscard]] std::vector<char> with_room(ThreadPool& pool) const;

 private:
  void read_runs(const Occupancy& occupancy, ThreadPool& pool);
  void smooth(ThreadPool& pool);
  void drop_steep(ThreadPool& pool);
  [[nodiscard]] float ceiling(std::size_t i) const;
  template <class Body>
  void for_all(ThreadPool& pool, const Body& body) const;

  Person person_;
  std::function<void()> progress_;
  Occupancy::Rect extent_;
  int width_ = 0;
  std::vector<std::uint32_t> first_;   // by column of the extent, row by row
  std::vector<std::uint32_t> column_;  // of each surface
  std::vector<Run> runs_;
  std::vector<float> height_;
  std::vector<char> open_;
};

}  // namespace catgs::walk
