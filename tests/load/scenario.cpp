#include "tests/load/scenario.h"

#include <algorithm>
#include <csignal>
#include <map>
#include <set>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include "render_core/base/error.h"
#include "render_core/base/nearest_name.h"
#include "tests/load/clock.h"
#include "tests/load/picture_check.h"

namespace catgs::load {
namespace {

InputError mistake(const std::string& path, const toml::node& node, std::string_view what,
                   std::string_view remedy = {}) {
  return InputError(path, fmt::format("line {}", node.source().begin.line), what, remedy);
}

/// A value of the file, as on a command line.
std::string text_of(const std::string& path, const toml::node& node) {
  if (const auto text = node.value_exact<std::string>()) return *text;
  if (const auto number = node.value_exact<std::int64_t>()) return std::to_string(*number);
  if (const auto number = node.value_exact<double>()) return fmt::format("{}", *number);
  if (const auto yes = node.value_exact<bool>()) return *yes ? "true" : "false";
  throw mistake(path, node, "neither a text, a number, true nor false");
}

std::vector<std::string> texts_of(const std::string& path, const toml::node& node) {
  if (!node.is_array()) return {text_of(path, node)};
  std::vector<std::string> texts;
  for (const toml::node& element : *node.as_array()) texts.push_back(text_of(path, element));
  return texts;
}

CLI::Option& option_called(const std::string& path, const std::string& name, const toml::node& node,
                           CLI::App& options) {
  if (CLI::Option* option = options.get_option_no_throw("--" + name)) return *option;
  std::vector<std::string> names;
  for (const CLI::Option* option : options.get_options())
    names.push_back(option->get_lnames().back());
  throw mistake(path, node, fmt::format("nothing is called \"{}\" here", name),
                suggest_name(name, names, fmt::format("one of {}", fmt::join(names, ", "))));
}

/// Gives each value of a table to the option of its name, but for the tables in it that the caller
/// reads.
void read_values(const std::string& path, const toml::table& table, CLI::App& options,
                 const std::set<std::string>& tables = {}) {
  options.set_help_flag();
  for (const auto& [key, node] : table) {
    const std::string name(key.str());
    if (tables.contains(name)) continue;
    CLI::Option& option = option_called(path, name, node, options);
    try {
      option.add_result(texts_of(path, node));
      option.run_callback();
    } catch (const CLI::Error& error) {
      throw mistake(path, node, error.what());
    } catch (const InputError& error) {
      throw mistake(path, node, error.what());
    }
  }
}

/// Tables under [[key]] or [key].
std::vector<const toml::table*> tables_of(const std::string& path, const toml::table& parent,
                                          std::string_view key) {
  const toml::node* node = parent.get(key);
  if (node == nullptr) return {};
  if (const toml::table* table = node->as_table()) return {table};
  if (!node->is_array_of_tables())
    throw mistake(path, *node, fmt::format("{} is not a table", key));
  std::vector<const toml::table*> tables;
  for (const toml::node& element : *node->as_array()) tables.push_back(element.as_table());
  return tables;
}

/// Sets what the table says.
void read_group(const std::filesystem::path& path, const toml::table& table, GroupOptions& group) {
  CLI::App options;
  add_client_options(options, group);
  options.add_option("--name", group.name);
  add_duration(options, "--start", group.start_s);
  add_duration(options, "--end", group.end_s);
  read_values(path.string(), table, options);
  if (!table.contains("trace") && !table.contains("traces")) return;
  for (std::string& trace : group.traces) trace = (path.parent_path() / trace).string();
}

/// A row of a matrix: its name, and the settings that it adds to its clients.
struct MatrixEntry {
  const toml::table* table;
  std::string name;
};

std::vector<MatrixEntry> entries_of(const std::string& path, const toml::table& matrix,
                                    const char* axis) {
  std::vector<MatrixEntry> entries;
  for (const toml::table* table : tables_of(path, matrix, axis)) {
    const auto name = (*table)["name"].value<std::string>();
    if (!name) throw mistake(path, *table, fmt::format("a {} of a matrix needs a name", axis));
    if (std::ranges::count(entries, *name, &MatrixEntry::name) > 0)
      throw mistake(path, *table, fmt::format("matrix.{}: two are called \"{}\"", axis, *name),
                    "give each a name of its own");
    entries.push_back({table, *name});
  }
  if (entries.empty())
    throw mistake(path, matrix, fmt::format("a matrix needs a [[matrix.{}]]", axis));
  return entries;
}

/// Each combination of scene, trace and link as a group of its own, one after the other. The server
/// gets the scenes.
void read_matrix(const std::filesystem::path& path, const toml::table& matrix,
                 const toml::table& clients, Scenario& scenario) {
  const std::string name = path.string();
  double row_s = 10.0;
  CLI::App options;
  add_duration(options, "--row", row_s);
  read_values(name, matrix, options, {"trace", "link"});
  if (scenario.check.scenes.empty()) throw mistake(name, matrix, "a matrix needs check-scene");
  std::set<std::string> scene_names;
  for (const std::string& scene : scenario.check.scenes) {
    if (!scene_names.insert(scene_name(scene)).second)
      throw mistake(name, matrix,
                    fmt::format("check-scene: two are called \"{}\"", scene_name(scene)),
                    "rename a file");
    scenario.server_args.insert(scenario.server_args.end(), {"--scene", scene});
    for (const MatrixEntry& trace : entries_of(name, matrix, "trace")) {
      for (const MatrixEntry& link : entries_of(name, matrix, "link")) {
        GroupOptions group;
        for (const toml::table* table : {&clients, trace.table, link.table})
          read_group(path, *table, group);
        group.wishes.scene = scene_name(scene);
        group.name = fmt::format("{}/{}/{}", group.wishes.scene, trace.name, link.name);
        group.start_s = row_s * static_cast<double>(scenario.load.groups.size());
        group.end_s = group.start_s + row_s;
        for (RateSchedule* rate : {&group.link.down, &group.link.up}) {
          for (RateStep& step : *rate)  // the first holds from the run's begin on
            if (step.from_us > 0) step.from_us += microseconds(group.start_s);
        }
        scenario.load.groups.push_back(std::move(group));
      }
    }
  }
  scenario.load.duration_s = scenario.load.groups.back().end_s;
}

ServerSignal read_signal(const std::string& path, const toml::table& table) {
  const std::map<std::string, int> numbers = {
      {"STOP", SIGSTOP}, {"CONT", SIGCONT}, {"TERM", SIGTERM}, {"HUP", SIGHUP}, {"KILL", SIGKILL}};
  ServerSignal signal;
  CLI::App options;
  options.add_option("--signal", signal.number)->transform(CLI::Transformer(numbers));
  add_duration(options, "--at", signal.at_s);
  read_values(path, table, options);
  return signal;
}

}  // namespace

Scenario read_scenario(const std::filesystem::path& path,
                       const std::vector<std::string>& check_scenes) {
  const std::string name = path.string();
  const toml::table table = [&] {
    try {
      return toml::parse_file(name);
    } catch (const toml::parse_error& error) {
      throw InputError(name, fmt::format("line {}", error.source().begin.line),
                       error.description());
    }
  }();
  Scenario scenario;
  CLI::App options;
  options.add_option("--title", scenario.title);
  add_duration(options, "--duration", scenario.load.duration_s);
  options.add_option("--require", scenario.requirements);
  options.add_option("--check-scene", scenario.check.scenes);
  options.add_option("--check-every", scenario.check.every)->check(CLI::Range(1, 10'000));
  options.add_option("--pictures", scenario.pictures)->check(CLI::Range(1, 256));
  read_values(name, table, options, {"held", "server", "clients", "matrix"});
  if (!check_scenes.empty()) scenario.check.scenes = check_scenes;
  for (const toml::table* held : tables_of(name, table, "held")) {
    CLI::App bounds;
    bounds.add_option("--pose-to-frame-p95-ms", scenario.bounds.pose_to_frame_p95_ms);
    bounds.add_option("--pose-age-p95-ms", scenario.bounds.pose_age_p95_ms);
    bounds.add_option("--psnr-db", scenario.bounds.psnr_db);
    read_values(name, *held, bounds);
  }
  for (const toml::table* server : tables_of(name, table, "server")) {
    CLI::App arguments;
    arguments.add_option("--args", scenario.server_args);
    read_values(name, *server, arguments, {"signals"});
    for (const toml::table* signal : tables_of(name, *server, "signals"))
      scenario.signals.push_back(read_signal(name, *signal));
  }
  const auto matrices = tables_of(name, table, "matrix"),
             groups = tables_of(name, table, "clients");
  if (!matrices.empty() && groups.size() > 1)
    throw mistake(name, *groups[1], "a matrix has one [[clients]], for all of its rows");
  for (const toml::table* clients : groups) {
    if (matrices.empty())
      read_group(path, *clients, scenario.load.groups.emplace_back());
    else
      read_matrix(path, *matrices[0], *clients, scenario);
  }
  if (scenario.load.groups.empty()) throw InputError(name, "", "has no [[clients]]");
  return scenario;
}

}  // namespace catgs::load
