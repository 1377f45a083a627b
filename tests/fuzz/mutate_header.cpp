#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "tests/fuzz/mutate.h"

namespace catgs::fuzz {
namespace {

constexpr std::string_view last_line = "end_header\n";

/// With their line ends.
std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t length = std::min(text.find('\n'), text.size() - 1) + 1;
    lines.emplace_back(text.substr(0, length));
    text.remove_prefix(length);
  }
  return lines;
}

struct File {
  std::vector<std::string> header;  // lines
  std::string body;
};

File split(const std::string& text) {
  const std::size_t found = text.find(last_line);
  const std::size_t end = found == std::string::npos ? text.size() : found + last_line.size();
  return {lines_of(std::string_view(text).substr(0, end)), text.substr(end)};
}

/// Counts around those of a block of rows and the limits of integers.
std::string count(const Material& from) {
  constexpr std::array<std::string_view, 14> counts = {
      "0",   "1",          "2",          "3",  "5", "255", "256",
      "257", "4294967295", "4294967296", "-1", "x", "1e3", "18446744073709551616"};
  return std::string(from.any_of(counts));
}

/// A word of `line` becomes another: one of the format, a count, or a long one.
void change_word(const Material& from, std::string& line) {
  std::vector<std::string> words;
  for (std::size_t at = 0; (at = line.find_first_not_of(" \t\r\n", at)) != std::string::npos;) {
    const std::size_t end = std::min(line.find_first_of(" \t\r\n", at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  if (words.empty()) words.emplace_back();
  std::string& word = words[from.below(words.size())];
  if (from.one_in(3))
    word = count(from);
  else if (from.one_in(8))
    word.assign(std::size_t{1} << from.below(11), 'a');
  else if (!from.words.empty())
    word = from.any_of(from.words);
  line.clear();
  for (const std::string& w : words) line += (line.empty() ? "" : " ") + w;
  line += "\n";
}

/// As many coefficients as SH of some degree have, or a few more, where the first one stood.
void put_coefficients(const Material& from, std::vector<std::string>& header) {
  constexpr std::array<std::size_t, 8> counts = {1, 3, 9, 10, 24, 27, 45, 72};
  const auto is_coefficient = [](const std::string& line) {
    return line.find(" f_rest_") != std::string::npos;
  };
  const auto first = std::ranges::find_if(header, is_coefficient);
  const auto at = first == header.end() ? static_cast<std::ptrdiff_t>(from.below(header.size()))
                                        : first - header.begin();
  std::erase_if(header, is_coefficient);
  const std::size_t count = from.any_of(counts);
  std::vector<std::string> lines;
  for (std::size_t k = 0; k < count; ++k)
    lines.push_back(fmt::format("property {} f_rest_{}\n", from.one_in(50) ? "float" : "uchar", k));
  header.insert(header.begin() + at, lines.begin(), lines.end());
}

void change_lines(const Material& from, File& file) {
  std::vector<std::string>& header = file.header;
  if (header.empty()) header.emplace_back("ply\n");
  const std::size_t at = from.below(header.size());
  const auto place = header.begin() + static_cast<std::ptrdiff_t>(at);
  switch (from.below(8)) {
    case 0:
      header.erase(place);
      break;
    case 1:
      header.insert(place, std::string(from.any_of(header)));
      break;
    case 2:
      std::swap(*place, header[from.below(header.size())]);
      break;
    case 3: {
      const File other = split(from.any_of(from.inputs));
      if (!other.header.empty()) header.insert(place, from.any_of(other.header));
      break;
    }
    case 4:
      put_coefficients(from, header);
      break;
    default:
      change_word(from, *place);
      break;
  }
}

}  // namespace

void change_header(const Material& from, std::string& text) {
  File file = split(text);
  if (from.one_in(4))
    change_bytes(from, file.body);
  else if (from.one_in(8))
    file.body.append(std::size_t{1} << from.below(14), static_cast<char>(from.random()));
  else
    change_lines(from, file);
  text.clear();
  for (const std::string& line : file.header) text += line;
  text += file.body;
}

}  // namespace catgs::fuzz
