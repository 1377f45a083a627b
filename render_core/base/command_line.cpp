#include "render_core/base/command_line.h"

#include <algorithm>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/nearest_name.h"

namespace catgs {
namespace {

/// Options of the program and of all its commands that take no negative numbers refuse them.
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

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  for (const CLI::App* command : app.get_subcommands())  // the commands that were given
    for (std::string& name : option_names(*command)) names.push_back(std::move(name));
  return names;
}

/// Throws where a command is required and an unknown word stands in its place.
void refuse_unknown_command(const CLI::App& app) {
  const std::vector<std::string> left = app.remaining(true);
  if (left.empty() || left.front().starts_with('-')) return;
  const CLI::App* last = &app;
  while (!last->get_subcommands().empty()) last = last->get_subcommands().back();
  std::vector<std::string> names;
  for (const CLI::App* command : last->get_subcommands({})) names.push_back(command->get_name());
  if (names.empty()) return;
  throw InputError("unknown command " + left.front(), "",
                   suggest_name(left.front(), names, "--help lists them"));
}

/// Names the first unknown word, options before others, because the others are probably values of
/// unknown options.
[[noreturn]] void refuse_unknown(const CLI::App& app, int argc, const char* const* argv) {
  const std::vector<std::string> left = app.remaining(true);
  std::string first;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (std::ranges::find(left, word) == left.end()) continue;
    if (word.size() > 1 && word.starts_with('-')) {
      const std::string name = word.substr(0, word.find('='));
      throw InputError("unknown option " + name, "",
                       suggest_name(name, option_names(app), "--help lists them"));
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
  } catch (const CLI::RequiredError&) {
    refuse_unknown_command(app);
    throw;
  } catch (const CLI::ExtrasError&) {
    refuse_unknown(app, argc, argv);
  }
}

std::string failure_text(const CLI::App* app, const CLI::Error& error) {
  std::string command = app->get_name() + " ";
  for (const CLI::App* given : app->get_subcommands()) command += given->get_name() + " ";
  return fmt::format("{}: {} (see {}--help)\n", app->get_name(), error.what(), command);
}

}  // namespace catgs
