#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "tests/fuzz/mutate.h"

namespace catgs::fuzz {
namespace {

constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
constexpr std::size_t most_values = 4096;

/// Where a value stands in its text. Those within it follow it in the list of all.
struct Value {
  std::size_t begin, end;
  std::size_t key_begin = none, key_end = none;  // of a member, with its quotation marks
  std::size_t next = 0;                          // in the list: behind those within this one

  [[nodiscard]] bool has_key() const { return key_begin != none; }
  /// Where the member begins.
  [[nodiscard]] std::size_t start() const { return has_key() ? key_begin : begin; }
};

std::size_t after_spaces(std::string_view text, std::size_t at) {
  return std::min(text.find_first_not_of(" \t\r\n", at), text.size());
}

bool is_open(char c) { return c == '{' || c == '['; }
bool is_close(char c) { return c == '}' || c == ']'; }

/// The end of the string, number or word that begins at `at`.
std::size_t end_of_scalar(std::string_view text, std::size_t at) {
  if (text[at] != '"') return std::min(text.find_first_of(" \t\r\n,:{}[]\"", at), text.size());
  for (++at; at < text.size() && text[at] != '"'; ++at)
    if (text[at] == '\\') ++at;
  return std::min(at + 1, text.size());
}

/// All values in the order of their begins. An edited copy of the text needs a new list.
std::vector<Value> values_of(std::string_view text) {
  std::vector<Value> values;
  std::vector<std::size_t> open;
  Value key{};
  const auto add = [&](std::size_t begin, std::size_t end) {
    values.push_back({begin, end, key.key_begin, key.key_end, values.size() + 1});
    key = {};
  };
  for (std::size_t at = 0; at < text.size() && values.size() < most_values;) {
    const char c = text[at];
    if (is_open(c)) {
      open.push_back(values.size());
      add(at, text.size());
      ++at;
    } else if (is_close(c)) {
      if (!open.empty()) {
        values[open.back()].end = at + 1;
        values[open.back()].next = values.size();
        open.pop_back();
      }
      ++at;
    } else if (c == ',' || c == ':' || after_spaces(text, at) != at) {
      ++at;
    } else {
      const std::size_t end = end_of_scalar(text, at);
      const std::size_t colon = after_spaces(text, end);
      if (c == '"' && colon < text.size() && text[colon] == ':')
        key.key_begin = at, key.key_end = end;
      else
        add(at, end);
      at = end;
    }
  }
  for (const std::size_t i : open) values[i].next = values.size();
  return values;
}

/// From the root down, a child at a time: long arrays of numbers would else be all that is chosen.
const Value* any_value(const Material& from, const std::vector<Value>& values) {
  const Value* chosen = nullptr;
  std::size_t begin = 0;
  std::size_t end = values.size();
  while (begin < end && (!chosen || !from.one_in(4))) {
    std::vector<std::size_t> children;
    for (std::size_t i = begin; i < end; i = values[i].next) children.push_back(i);
    begin = from.any_of(children);
    chosen = &values[begin];
    end = values[begin].next;
    ++begin;
  }
  return chosen;
}

std::string_view text_of(std::string_view text, const Value& value) {
  return text.substr(value.begin, value.end - value.begin);
}

std::string quoted(std::string_view text) { return fmt::format("\"{}\"", text); }

/// Mostly short, for what is long makes all that follows from it slow.
std::size_t any_length(const Material& from, std::size_t log2_of_longest) {
  return from.below(std::size_t{1} << from.below(log2_of_longest + 1));
}

std::string long_text(const Material& from) { return std::string(any_length(from, 15), 'a'); }

/// Of all lengths, with and without a fraction and an exponent.
std::string any_number(const Material& from) {
  const auto digits = [&] { return from.random() >> from.below(64); };
  std::string number = fmt::format("{}{}", from.one_in(4) ? "-" : "", digits());
  if (from.one_in(2)) number += fmt::format(".{}", digits());
  if (from.one_in(2))
    number += fmt::format("e{}{}", from.one_in(2) ? "-" : "", any_length(from, 9));
  return number;
}

std::string scalar(const Material& from) {
  constexpr std::array<std::string_view, 32> scalars = {"null",
                                                        "true",
                                                        "false",
                                                        "0",
                                                        "-0",
                                                        "-1",
                                                        "1",
                                                        "2",
                                                        "16",
                                                        "17",
                                                        "65536",
                                                        "65537",
                                                        "268435456",
                                                        "268435457",
                                                        "2147483648",
                                                        "4294967296",
                                                        "9223372036854775807",
                                                        "-9223372036854775808",
                                                        "-9223372036854775809",
                                                        "18446744073709551615",
                                                        "18446744073709551616",
                                                        "0.1",
                                                        "-0.0",
                                                        "1e-320",
                                                        "1e38",
                                                        "1e39",
                                                        "1e400",
                                                        "\"\"",
                                                        "[]",
                                                        "{}",
                                                        "[[]]",
                                                        "{\"\":0}"};
  if (from.one_in(8)) return quoted(long_text(from));
  return from.one_in(4) ? any_number(from) : std::string(from.any_of(scalars));
}

/// A key with its quotation marks: a word of the format, an index, or one that nobody knows.
std::string key(const Material& from) {
  if (from.one_in(4)) return quoted(std::to_string(from.below(20)));
  if (from.one_in(16)) return quoted(any_number(from));
  if (from.one_in(8)) return quoted(long_text(from));
  if (from.words.empty()) return quoted("a");
  const std::string& word = from.any_of(from.words);
  return word.starts_with('"') && word.ends_with("\":") ? word.substr(0, word.size() - 1)
                                                        : quoted(word);
}

/// What is written for a value: one of an input or a scalar.
std::string any_text(const Material& from) {
  if (from.one_in(2)) return scalar(from);
  const std::string& other = from.any_of(from.inputs);
  const std::vector<Value> values = values_of(other);
  const Value* value = any_value(from, values);
  return value ? std::string(text_of(other, *value)) : scalar(from);
}

void erase(std::string& text, const Value& value) {
  std::size_t begin = value.start();
  std::size_t end = after_spaces(text, value.end);
  if (end < text.size() && text[end] == ',') {
    ++end;
  } else {
    end = value.end;
    const std::size_t before = text.find_last_not_of(" \t\r\n", begin - (begin > 0 ? 1 : 0));
    if (before != std::string::npos && text[before] == ',') begin = before;
  }
  text.erase(begin, end - begin);
}

/// More of the same; members of an object under other keys.
void repeat(const Material& from, std::string& text, const Value& value) {
  const std::size_t times = 1 + any_length(from, 9);
  const std::size_t most_bytes = any_length(from, 14);
  const std::string content(text_of(text, value));
  std::string more;
  for (std::size_t i = 0; i == 0 || (i < times && more.size() < most_bytes); ++i)
    more += fmt::format(",{}{}", value.has_key() ? key(from) + ":" : "", content);
  text.insert(value.end, more);
}

void insert_member(const Material& from, std::string& text, const Value& value) {
  const std::size_t at = value.begin + 1;
  const std::size_t next = after_spaces(text, at);
  const bool empty = next == text.size() || is_close(text[next]);
  const std::string name = text[value.begin] == '{' ? key(from) + ":" : "";
  text.insert(at, name + any_text(from) + (empty ? "" : ","));
}

void exchange(std::string& text, const Value& a, const Value& b) {
  if (a.begin > b.begin) return exchange(text, b, a);
  if (a.end > b.begin) return;  // one within the other
  const std::string first(text_of(text, a));
  const std::string second(text_of(text, b));
  text.replace(b.begin, second.size(), first);
  text.replace(a.begin, first.size(), second);
}

/// All scalars within the value become one, which is mostly shorter.
void level(const Material& from, std::string& text, const std::vector<Value>& values,
           const Value& value) {
  const std::string one = scalar(from);
  const auto first = static_cast<std::size_t>(&value - values.data());
  for (std::size_t i = value.next; i-- > first;)
    if (!is_open(text[values[i].begin]))
      text.replace(values[i].begin, values[i].end - values[i].begin, one);
}

void wrap(const Material& from, std::string& text, const Value& value) {
  const std::size_t depth = 1 + any_length(from, 9);
  const bool object = from.one_in(2);
  std::string before;
  for (std::size_t i = 0; i < depth; ++i) before += object ? fmt::format("{{{}:", key(from)) : "[";
  text.insert(value.end, std::string(depth, object ? '}' : ']'));
  text.insert(value.begin, before);
}

/// Into a string: escapes, the first and last of each length of UTF-8, and what is neither.
void spoil_string(const Material& from, std::string& text, const Value& value) {
  constexpr std::array<std::string_view, 30> pieces = {"\\n",
                                                       "\\\"",
                                                       "\\\\",
                                                       "\\/",
                                                       "\\b",
                                                       "\\f",
                                                       "\\r",
                                                       "\\t",
                                                       "\\u00e9",
                                                       "\\u0001",
                                                       "\\u20AC",
                                                       "\\ud83d\\ude00",
                                                       "\\ud800",
                                                       "\\udc00",
                                                       "\\ud800\\n",
                                                       "\\ud800\\u0041",
                                                       "\\u12g4",
                                                       "\\x",
                                                       "\xc3\xa9",
                                                       "\xe0\xa0\x80",
                                                       "\xe2\x82\xac",
                                                       "\xed\x9f\xbf",
                                                       "\xed\xa0\x80",
                                                       "\xf0\x90\x80\x80",
                                                       "\xf1\x80\x80",
                                                       "\xf3\xbf\xbf\xbf",
                                                       "\xf4\x8f\xbf\xbf",
                                                       "\xf4\x90\x80\x80",
                                                       "\xff",
                                                       "\x7f"};
  std::string piece(from.any_of(pieces));
  if (from.one_in(4)) piece.assign(1, static_cast<char>(from.below(32)));
  if (from.one_in(8)) piece.pop_back();
  text.insert(value.begin + 1 + from.below(value.end - value.begin - 1), piece);
}

void spoil_number(const Material& from, std::string& text, const Value& value) {
  constexpr std::array<std::string_view, 12> pieces = {
      "0", "-", ".", ".5", "e", "e5", "E-3", "e+", "e400", "1", "99999999999999999999", "x"};
  text.insert(value.begin + from.below(value.end - value.begin + 1), from.any_of(pieces));
}

void spoil(const Material& from, std::string& text, const Value& value) {
  const char c = text[value.begin];
  if (is_open(c))
    insert_member(from, text, value);
  else if (c == '"' && value.end > value.begin + 1)
    spoil_string(from, text, value);
  else
    spoil_number(from, text, value);
}

}  // namespace

void change_json(const Material& from, std::string& text) {
  const std::vector<Value> values = values_of(text);
  const Value* value = any_value(from, values);
  if (!value) {
    text = scalar(from);
    return;
  }
  switch (from.below(10)) {
    case 0:
      return erase(text, *value);
    case 1:
      return repeat(from, text, *value);
    case 2:
      return exchange(text, *value, *any_value(from, values));
    case 3:
      return wrap(from, text, *value);
    case 4:
      if (value->has_key())
        text.replace(value->key_begin, value->key_end - value->key_begin, key(from));
      return;
    case 5:
    case 6:
      return spoil(from, text, *value);
    case 7:
      return level(from, text, values, *value);
    case 8:
      text.replace(value->begin, value->end - value->begin, scalar(from));
      return;
    default:
      text.replace(value->begin, value->end - value->begin, any_text(from));
      return;
  }
}

}  // namespace catgs::fuzz
