#pragma once

#include <algorithm>
#include <cstdint>

namespace catgs {

/// An even sample of numbered things: one of each `step`, at a position that varies like chance.
/// Files are often ordered row by row, so that every n-th thing may lie on one line.
class EvenSample {
 public:
  /// Takes at most `most` of `size` things.
  EvenSample(std::uint64_t size, std::uint64_t most)
      : step_(std::max<std::uint64_t>(1, (size + most - 1) / most)),
        count_((size + step_ - 1) / step_) {}

  [[nodiscard]] std::uint64_t size() const { return count_; }
  /// Each stands for so many.
  [[nodiscard]] std::uint64_t step() const { return step_; }
  /// The number of the k-th of the sample. They ascend.
  std::uint64_t operator[](std::uint64_t k) const { return number(k, step_); }
  [[nodiscard]] bool contains(std::uint64_t i) const {
    return number((i + step_ - 1) / step_, step_) == i;
  }

  /// Between (k - 1) * step, which is left out, and k * step.
  static std::uint64_t number(std::uint64_t k, std::uint64_t step) {
    if (k == 0 || step == 1) return k * step;
    std::uint64_t chance = k * 0x9e3779b97f4a7c15;  // splitmix64
    chance = (chance ^ (chance >> 30)) * 0xbf58476d1ce4e5b9;
    chance = (chance ^ (chance >> 27)) * 0x94d049bb133111eb;
    return k * step - (chance ^ (chance >> 31)) % step;
  }

 private:
  std::uint64_t step_, count_;
};

}  // namespace catgs
