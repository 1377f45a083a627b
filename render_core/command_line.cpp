#include "render_core/command_line.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "render_core/error.h"

namespace catgs {
namespace {

/// Numbers that cannot be negative, of the program and of all its commands.
void refuse_negative_numbers(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    if (!option->get_type_name().starts_with("UINT")) continue;
    option->check(
        [](const std::string& text) {
          return text.starts_with('-') ? fmt::format("{} is negative", text) : std::string();
        },
        "");
  }
  for (CLI::App* command : app.get_subcommands({})) refuse_negative_numbers(*command);
}

/// Letters to be put in, taken away or changed.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, changed});
    }
  }
  return row.back();
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  for (const CLI::App* command : app.get_subcommands())  // those that were given
    for (std::string& name : option_names(*command)) names.push_back(std::move(name));
  return names;
}

std::string suggestion(const CLI::App& app, std::string_view unknown) {
  std::string nearest;
  std::size_t least = unknown.size() / 3;
  for (const std::string& name : option_names(app)) {
    const std::size_t distance = edit_distance(unknown, name);
    if (distance > least || (distance == least && !nearest.empty())) continue;
    least = distance;
    nearest = name;
  }
  return nearest.empty() ? "--help lists them" : fmt::format("did you mean {}?", nearest);
}

/// The first word that nothing takes; an option before others, as those are probably its values.
[[noreturn]] void refuse_unknown(const CLI::App& app, int argc, const char* const* argv) {
  const std::vector<std::string> left = app.remaining(true);
  std::string first;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (std::ranges::find(left, word) == left.end()) continue;
    if (word.size() > 1 && word.starts_with('-')) {
      const std::string name = word.substr(0, word.find('='));
      throw InputError("unknown option " + name, "", suggestion(app, name));
    }
    if (first.empty()) first = word;
  }
  throw InputError(fmt::format("\"{}\"", first), "", "is one word too many", "see --help");
}

}  // namespace

void parse_command_line(CLI::App& app, int argc, const char* const* argv) {
  refuse_negative_numbers(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ExtrasError&) {
    refuse_unknown(app, argc, argv);
  }
}

}  // namespace catgs
