#include "render_core/scene/formats/model_statements.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/formats/format_limits.h"

namespace catgs {

namespace {

constexpr std::size_t most_text = 400;  // a longer comment is no statement

/// Lower-case words without "_" and "-": exporters write "anti-aliasing" in several ways.
std::vector<std::string> words_of(std::string_view text) {
  constexpr std::string_view between = " \t\r\n:=|,;()\"'";
  std::vector<std::string> words(1);
  for (const char c : text) {
    if (c == '_' || c == '-') continue;
    if (between.find(c) == std::string_view::npos)
      words.back().push_back(to_lower(c));
    else if (!words.back().empty())
      words.emplace_back();
  }
  if (words.back().empty()) words.pop_back();
  return words;
}

template <std::size_t Size>
bool is_one_of(std::string_view word, const std::array<std::string_view, Size>& words) {
  return std::ranges::find(words, word) != words.end();
}

bool is_about_antialiasing(std::string_view word) {
  return word.find("antialias") != std::string_view::npos;
}

bool names_model(std::string_view word) {
  constexpr std::array<std::string_view, 4> ends = {"rendermode", "rasterizemode",
                                                    "rasterizationmode", "splatmodel"};
  return std::ranges::any_of(ends, [&](std::string_view end) { return word.ends_with(end); });
}

bool is_key(std::string_view word) { return is_about_antialiasing(word) || names_model(word); }

/// A word that names a model wherever it is.
bool is_model_word(std::string_view word) {
  constexpr std::array<std::string_view, 5> known = {"mip", "mipsplatting", "2dgs", "surfel",
                                                     "surfels"};
  return is_one_of(word, known);
}

std::optional<SplatModel> model_of(std::string_view value, bool as_flag) {
  constexpr std::array<std::string_view, 4> on = {"1", "true", "yes", "on"};
  constexpr std::array<std::string_view, 4> off = {"0", "false", "no", "off"};
  if (as_flag && is_one_of(value, on)) return SplatModel::antialiased;
  if (as_flag && is_one_of(value, off)) return SplatModel::standard;
  if (value.starts_with("mip") || is_about_antialiasing(value)) return SplatModel::antialiased;
  if (value.starts_with("surfel")) return SplatModel::surfels;
  if (value == "classic") return SplatModel::standard;
  return splat_model_named(value);
}

/// The model of "[word] key [type] value"; nothing for other texts.
std::optional<SplatModel> model_stated(const std::vector<std::string>& words) {
  constexpr std::array<std::string_view, 5> types = {"int64", "int", "bool", "str", "double"};
  const auto key = static_cast<std::size_t>(std::ranges::find_if(words, is_key) - words.begin());
  if (key > 1 || key >= words.size()) return std::nullopt;
  std::size_t value = key + 1;
  if (value + 2 == words.size() && is_one_of(words[value], types)) ++value;
  if (value + 1 != words.size()) return std::nullopt;
  return model_of(words[value], is_about_antialiasing(words[key]));
}

void add_unclear(std::vector<std::string>& notes, std::string_view text) {
  add_note(notes, fmt::format("'{}' may be about the model, and is not understood as a whole; "
                              "--model or the sidecar's \"model\" says how it is drawn",
                              text));
}

}  // namespace

void ModelStatements::read(std::string_view text) {
  if (text.size() > most_text) return;
  const std::vector<std::string> words = words_of(text);
  if (words == std::vector<std::string>{"vertical", "axis", "z"}) usual_up = UsualUp::plus_z;
  const auto stated = model_stated(words);
  if (stated) model = stated;
  // "mip0.1" tells the width of the filter, too, and that is always ours.
  const bool exact = stated && !std::ranges::any_of(words, [](std::string_view word) {
                       return word.starts_with("mip") && !is_model_word(word);
                     });
  const bool is_about_model = std::ranges::any_of(
      words, [](std::string_view word) { return is_key(word) || is_model_word(word); });
  if (is_about_model && !exact) add_unclear(notes, text);
}

void ModelStatements::read_members(const nlohmann::json& object) {
  if (!object.is_object()) return;
  for (const auto& [key, value] : object.items()) {
    if (value.is_structured() || value.is_null()) continue;
    const std::string text = value.is_string() ? value.get<std::string>() : value.dump();
    if (key != "model")
      read(fmt::format("{}: {}", key, text));
    else if (const auto known = splat_model_named(text))
      model = known;
    else
      add_unclear(notes, fmt::format("model: {}", text));
  }
}

}  // namespace catgs
