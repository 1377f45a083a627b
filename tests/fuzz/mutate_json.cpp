#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tests/fuzz/mutate.h"

namespace catgs::fuzz {
namespace {

using Json = nlohmann::ordered_json;

/// Stands in a document for a text that Json cannot hold, such as 1e400.
constexpr std::string_view raw_place = "@raw@";

/// Discarded if the text is no JSON. What lies deep is left out, because the library writes by
/// recursion.
Json parse(const std::string& text) {
  constexpr int max_depth = 500;
  return Json::parse(
      text, [](int depth, Json::parse_event_t, Json&) { return depth < max_depth; }, false);
}

std::string written(const Json& value) {
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

bool has_children(const Json& value) { return value.is_structured() && !value.empty(); }

Json::iterator any_child(const Material& from, Json& parent) {
  return std::next(parent.begin(), static_cast<std::ptrdiff_t>(from.below(parent.size())));
}

/// From the root down, a child at a time: else long arrays of numbers would be all that is chosen.
Json& any_value(const Material& from, Json& document) {
  Json* chosen = &document;
  while (has_children(*chosen) && !from.one_in(4)) chosen = &*any_child(from, *chosen);
  return *chosen;
}

/// The same, but one that has children. The root must have some.
Json& any_parent(const Material& from, Json& document) {
  Json* chosen = &document;
  while (!from.one_in(4)) {
    Json& child = *any_child(from, *chosen);
    if (!has_children(child)) break;
    chosen = &child;
  }
  return *chosen;
}

/// Mostly short, because long ones slow down all that follows from them.
std::size_t any_length(const Material& from, std::size_t log2_of_longest) {
  return from.below(std::size_t{1} << from.below(log2_of_longest + 1));
}

std::string any_scalar(const Material& from) {
  static const std::vector<std::string> scalars = words_of(
      "null true false 0 -0 -1 1 2 16 17 65536 65537 268435456 268435457 2147483648 4294967296 "
      "9223372036854775807 -9223372036854775808 -9223372036854775809 18446744073709551615 "
      "18446744073709551616 0.1 -0.0 1e-320 1e38 1e39 1e400 \"\" [] {} [[]] {\"\":0}");
  if (from.one_in(8)) return fmt::format("\"{}\"", std::string(any_length(from, 15), 'a'));
  if (from.one_in(4)) return fmt::format("{}e{}", from.random(), any_length(from, 9));
  return from.any_of(scalars);
}

/// A key: one of the format, an index, or one that nobody knows.
std::string any_key(const Material& from) {
  if (from.one_in(4)) return std::to_string(from.below(20));
  if (from.words.empty() || from.one_in(8)) return std::string(any_length(from, 15), 'a');
  const std::string& word = from.any_of(from.words);
  return word.starts_with('"') ? word.substr(1, word.find('"', 1) - 1) : word;
}

void add_child(const Material& from, Json& parent, const Json& child) {
  if (parent.is_object())
    parent[any_key(from)] = child;
  else
    parent.insert(any_child(from, parent), child);
}

/// Deeper by many levels.
std::string wrapped(const Material& from, const std::string& text) {
  const std::size_t depth = 1 + any_length(from, 9);
  const bool object = from.one_in(2);
  std::string before;
  for (std::size_t i = 0; i < depth; ++i)
    before += object ? fmt::format("{{\"{}\":", any_key(from)) : "[";
  return before + text + std::string(depth, object ? '}' : ']');
}

}  // namespace

void change_json(const Material& from, std::string& text) {
  Json document = parse(text);
  Json other = parse(from.any_of(from.inputs));
  if (!has_children(document) || other.is_discarded()) return change_bytes(from, text);
  std::string raw = any_scalar(from);
  Json& parent = any_parent(from, document);
  const auto child = any_child(from, parent);
  const Json content = *child;
  switch (from.below(7)) {
    case 0:
      parent.erase(child);
      break;
    case 1: {
      const std::size_t room = any_length(from, 14) / written(content).size();
      const std::size_t times = 1 + std::min(any_length(from, 9), room);
      for (std::size_t i = 0; i < times; ++i) add_child(from, parent, content);
      break;
    }
    case 2:  // under another key, or elsewhere in the array
      parent.erase(child);
      if (!parent.empty()) add_child(from, parent, content);
      break;
    case 3:
      add_child(from, parent, from.one_in(2) ? any_value(from, other) : Json(raw_place));
      break;
    case 4:
      raw = wrapped(from, written(content));
      *child = raw_place;
      break;
    case 5:
      *child = raw_place;
      break;
    default:
      *child = any_value(from, other);
      break;
  }
  text = written(document);
  const std::string place = fmt::format("\"{}\"", raw_place);
  if (const std::size_t at = text.find(place); at != std::string::npos)
    text.replace(at, place.size(), raw);
}

}  // namespace catgs::fuzz
