#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "render_core/base/thread_pool.h"

namespace catgs {

/// 256 ascending values that stand for many.
class Codebook {
 public:
  /// Finds values with a small squared error by Lloyd's algorithm. Rare values keep errors of the
  /// size of common ones, but for extremes: those under 1 % cost the others nearly nothing.
  /// `values` are finite and not none.
  explicit Codebook(std::vector<float> values);
  /// Index of the nearest value.
  [[nodiscard]] std::uint8_t nearest(float value) const;
  [[nodiscard]] const std::array<float, 256>& values() const { return values_; }

 private:
  /// In each round, each value becomes the mean of those that are nearest to it.
  void move_to_means(const std::vector<float>& sorted, int rounds);

  std::array<float, 256> values_{};
  std::array<float, 255> middles_{};  // between neighbours
};

/// Vectors of `dims` numbers, `stride` apart. A palette takes at most 48, the harmonics of
/// degree 3.
struct VectorTable {
  const float* first = nullptr;
  std::size_t count = 0, stride = 0, dims = 0;
  [[nodiscard]] const float* operator[](std::size_t i) const { return first + i * stride; }
};

/// Vectors that stand for many, and which stands for which.
struct Palette {
  std::vector<float> entries;         // `dims` numbers each
  std::vector<std::uint32_t> labels;  // index of the entry of each vector
};

/// Finds at most `size` entries with a small squared error by a tree of k-means: each node divides
/// its vectors among 16 children, and its entries by their squared errors. Vectors that are far
/// from all others share no entry with them. The time is usually linear in the number of vectors.
/// The result depends neither on the number of threads nor on the machine.
Palette make_palette(const VectorTable& vectors, std::size_t size, ThreadPool& pool);

}  // namespace catgs
