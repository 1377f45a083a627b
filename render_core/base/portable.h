#pragma once

#include <cstdint>

// Functions with the same bits on every machine, for poses and scenes made from a seed. They are
// integer random numbers, and the part of sine and cosine that does not depend on the precision.
// The C library's sin differs in the last bit between versions; the distributions of <random>
// differ between standard libraries.
namespace catgs {

/// SplitMix64's finaliser (Steele, Lea, Flood 2014): a bijection that spreads every input bit.
constexpr std::uint64_t mix_bits(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

/// SplitMix64's increment, odd and without a pattern: 2^64 / golden ratio.
inline constexpr std::uint64_t golden_gamma = 0x9e3779b97f4a7c15u;

/// SplitMix64: 64 bits of state, draw n a pure function of (seed, n).
class SplitMix64 {
 public:
  explicit constexpr SplitMix64(std::uint64_t seed) : state_(seed) {}
  constexpr std::uint64_t next() { return mix_bits(state_ += golden_gamma); }

 private:
  std::uint64_t state_;
};

template <class T>
struct SinCos {
  T sin;
  T cos;
};

/// Sine and cosine of an angle, from those of the same angle minus `quarters` right angles.
template <class T>
constexpr SinCos<T> add_quarters(const SinCos<T>& rest, std::int64_t quarters) {
  switch (quarters & 3) {
    case 0:
      return rest;
    case 1:
      return {rest.cos, -rest.sin};
    case 2:
      return {-rest.sin, -rest.cos};
    default:
      return {-rest.cos, rest.sin};
  }
}

}  // namespace catgs
