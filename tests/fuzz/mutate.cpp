#include "tests/fuzz/mutate.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

namespace catgs::fuzz {
namespace {

/// A number of [0, end); 0 where that is empty.
std::size_t below(std::mt19937_64& random, std::size_t end) {
  return end == 0 ? 0 : static_cast<std::size_t>(random() % end);
}

const std::string& any_of(std::mt19937_64& random, std::span<const std::string> texts) {
  return texts[below(random, texts.size())];
}

/// Where and how long: short ranges are likelier, for they leave more of the input whole.
struct Range {
  std::size_t begin;
  std::size_t length;
};

Range any_range(std::mt19937_64& random, const std::string& text) {
  const std::size_t begin = below(random, text.size());
  const std::size_t longest = std::min(text.size() - begin, std::size_t{1} << below(random, 12));
  return {begin, longest == 0 ? 0 : 1 + below(random, longest)};
}

/// Numbers around which parsers err, in one to eight bytes, least significant first.
std::string edge_number(std::mt19937_64& random) {
  using Limits = std::numeric_limits<std::int64_t>;
  constexpr std::array<std::int64_t, 16> edges = {0,
                                                  1,
                                                  -1,
                                                  2,
                                                  127,
                                                  128,
                                                  255,
                                                  256,
                                                  0x7f80'00,
                                                  0x7fff'ffff,
                                                  0x8000'0000,
                                                  0xffff'ffff,
                                                  0x7f80'0000,
                                                  0x7fc0'0000,
                                                  Limits::max(),
                                                  Limits::min()};
  auto value = static_cast<std::uint64_t>(edges[below(random, edges.size())]);
  std::string bytes(std::size_t{1} << below(random, 4), '\0');
  for (char& byte : bytes) {
    byte = static_cast<char>(value & 0xff);
    value >>= 8;
  }
  return bytes;
}

/// Digits as texts have them.
std::string written_number(std::mt19937_64& random) {
  constexpr std::array<const char*, 10> numbers = {
      "0", "-1", "1e38", "1e400", "-0.0", "nan", "65536", "4294967296", "2147483648", "1e-320"};
  return numbers[below(random, numbers.size())];
}

void change(std::mt19937_64& random, std::string& text, std::span<const std::string> inputs,
            std::span<const std::string> words) {
  const Range range = any_range(random, text);
  const std::size_t place = below(random, text.size() + 1);
  const auto put = [&](const std::string& piece) {
    if (random() % 2 == 0)
      text.insert(place, piece);
    else
      text.replace(place, piece.size(), piece);
  };
  switch (below(random, 9)) {
    case 0:
      if (!text.empty()) text[range.begin] ^= static_cast<char>(1 << below(random, 8));
      break;
    case 1:
      if (!text.empty()) text[range.begin] = static_cast<char>(random());
      break;
    case 2:
      text.erase(range.begin, range.length);
      break;
    case 3:
      text.insert(place, text.substr(range.begin, range.length));
      break;
    case 4:
      put(edge_number(random));
      break;
    case 5:
      put(written_number(random));
      break;
    case 6:
      if (!words.empty()) put(any_of(random, words));
      break;
    case 7: {
      const std::string& other = any_of(random, inputs);
      const Range piece = any_range(random, other);
      put(other.substr(piece.begin, piece.length));
      break;
    }
    default:
      text.resize(place);
      break;
  }
}

}  // namespace

std::string mutant(std::mt19937_64& random, std::span<const std::string> inputs,
                   std::span<const std::string> words, std::size_t max_bytes) {
  std::string text = any_of(random, inputs);
  do change(random, text, inputs, words);
  while (random() % 4 != 0);
  text.resize(std::min(text.size(), max_bytes));
  return text;
}

}  // namespace catgs::fuzz
