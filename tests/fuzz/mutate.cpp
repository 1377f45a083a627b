#include "tests/fuzz/mutate.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <sstream>

namespace catgs::fuzz {
namespace {

/// Where and how long: short ranges are likelier, for they leave more of the input whole.
struct Range {
  std::size_t begin;
  std::size_t length;
};

Range any_range(const Material& from, const std::string& text) {
  const std::size_t begin = from.below(text.size());
  const std::size_t longest = std::min(text.size() - begin, std::size_t{1} << from.below(12));
  return {begin, longest == 0 ? 0 : 1 + from.below(longest)};
}

/// Numbers around which parsers err, in one to eight bytes, least significant first: powers of two
/// and those beside them, infinity and NaN of floats.
std::string edge_number(const Material& from) {
  constexpr std::array<std::uint64_t, 2> floats = {0x7f80'0000, 0x7fc0'0000};
  std::uint64_t value = (std::uint64_t{1} << from.below(64)) + from.below(3) - 1;
  if (from.one_in(8)) value = from.any_of(floats);
  std::string bytes(std::size_t{1} << from.below(4), '\0');
  for (char& byte : bytes) {
    byte = static_cast<char>(value & 0xff);
    value >>= 8;
  }
  return bytes;
}

/// Digits as texts have them.
std::string written_number(const Material& from) {
  constexpr std::array<const char*, 10> numbers = {
      "0", "-1", "1e38", "1e400", "-0.0", "nan", "65536", "4294967296", "2147483648", "1e-320"};
  return numbers[from.below(numbers.size())];
}

}  // namespace

void change_bytes(const Material& from, std::string& text) {
  const Range range = any_range(from, text);
  const std::size_t place = from.below(text.size() + 1);
  const auto put = [&](const std::string& piece) {
    if (from.one_in(2))
      text.insert(place, piece);
    else
      text.replace(place, piece.size(), piece);
  };
  switch (from.below(9)) {
    case 0:
      if (!text.empty()) text[range.begin] ^= static_cast<char>(1 << from.below(8));
      break;
    case 1:
      if (!text.empty()) text[range.begin] = static_cast<char>(from.random());
      break;
    case 2:
      text.erase(range.begin, range.length);
      break;
    case 3:
      text.insert(place, text.substr(range.begin, range.length));
      break;
    case 4:
      put(edge_number(from));
      break;
    case 5:
      put(written_number(from));
      break;
    case 6:
      if (!from.words.empty()) put(from.any_of(from.words));
      break;
    case 7: {
      const std::string& other = from.any_of(from.inputs);
      const Range piece = any_range(from, other);
      put(other.substr(piece.begin, piece.length));
      break;
    }
    default:
      text.resize(place);
      break;
  }
}

std::vector<std::string> words_of(std::string_view text) {
  std::istringstream in{std::string(text)};
  return {std::istream_iterator<std::string>(in), {}};
}

std::string mutant(const Material& material, Change change, std::size_t max_bytes) {
  std::string text = material.any_of(material.inputs);
  do (change && material.one_in(2) ? change : change_bytes)(material, text);
  while (!material.one_in(4));
  text.resize(std::min(text.size(), max_bytes));
  return text;
}

}  // namespace catgs::fuzz
