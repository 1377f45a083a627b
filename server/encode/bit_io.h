#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace catgs::h264 {

/// Reads bits, most significant first, from a raw byte sequence payload (no emulation prevention
/// bytes). Past the end it yields zeros and `failed()` turns true, so that a parser may check once.
class BitReader {
 public:
  explicit BitReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  bool flag() {
    if (position_ >= bytes_.size() * 8) {
      failed_ = true;
      return false;
    }
    const auto byte = std::to_integer<unsigned>(bytes_[position_ / 8]);
    const bool bit = (byte >> (7 - position_ % 8) & 1) != 0;
    ++position_;
    return bit;
  }

  /// u(n) of 7.2, n <= 32.
  std::uint32_t bits(int count) {
    std::uint32_t value = 0;
    for (int i = 0; i < count; ++i) value = value << 1 | static_cast<std::uint32_t>(flag());
    return value;
  }

  /// ue(v) of 9.1: at most 32 leading zeros in any valid stream.
  std::uint32_t exp_golomb() {
    int zeros = 0;
    while (!flag()) {
      if (failed_ || ++zeros > 31) {
        failed_ = true;
        return 0;
      }
    }
    return (std::uint32_t{1} << zeros) - 1 + bits(zeros);
  }

  /// se(v) of 9.1.1.
  std::int32_t signed_exp_golomb() {
    const std::uint32_t code = exp_golomb();
    const auto half = static_cast<std::int32_t>((code + 1) / 2);
    return code % 2 != 0 ? half : -half;
  }

  void fail() { failed_ = true; }
  [[nodiscard]] bool failed() const { return failed_; }
  [[nodiscard]] std::size_t position() const { return position_; }  // bits read so far

 private:
  std::span<const std::byte> bytes_;
  std::size_t position_ = 0;
  bool failed_ = false;
};

/// Writes bits, most significant first.
class BitWriter {
 public:
  void flag(bool value) {
    if (free_bits_ == 0) {
      bytes_.push_back(std::byte{0});
      free_bits_ = 8;
    }
    --free_bits_;
    if (value) bytes_.back() |= std::byte{1} << free_bits_;
  }

  /// u(n), n <= 32.
  void bits(std::uint32_t value, int count) {
    for (int i = count - 1; i >= 0; --i) flag((value >> i & 1) != 0);
  }

  /// ue(v), value < 2^32 - 1.
  void exp_golomb(std::uint32_t value) {
    const int width = std::bit_width(value + 1);
    bits(0, width - 1);
    bits(value + 1, width);
  }

  /// rbsp_trailing_bits: a one, then zeros up to the byte's end.
  std::vector<std::byte> finish() && {
    flag(true);
    return std::move(bytes_);
  }

 private:
  std::vector<std::byte> bytes_;
  int free_bits_ = 0;  // in the last byte
};

}  // namespace catgs::h264
