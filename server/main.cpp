// catgs-server: renders 3D Gaussian Splatting scenes and streams them to browsers.

#include <cstdlib>
#include <exception>
#include <iostream>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include "render_core/base/build_info.h"
#include "render_core/base/command_line.h"
#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/frame/device_error.h"
#include "server/base/log.h"
#include "server/commands.h"
#include "server/config/config.h"
#include "server/server.h"

namespace catgs {
namespace {

constexpr int exit_ok = 0;
constexpr int exit_failure = 1;
constexpr int exit_usage = 2;

/// Returns freed memory to the system. Large blocks (scenes, pictures, encoders' buffers, but
/// nothing that is made for each frame) become mappings, which go back when freed. By default glibc
/// raises the mapping threshold to the largest block ever freed, up to 32 MiB. A fixed threshold
/// also stops glibc from adapting the trim threshold. That is therefore set too, wide enough for
/// the blocks of frames. The number of heaps is that of threads that run at a time, because glibc's
/// eight for each processor take long to fill.
void bound_heaps() {
  ::mallopt(M_MMAP_THRESHOLD, 1 << 20);
  ::mallopt(M_TRIM_THRESHOLD, 8 << 20);
  ::mallopt(M_ARENA_MAX, processors());
}

/// Flags as they were given, by setting name; applied after the file and the environment.
struct CommandLine {
  std::string config_file;
  bool print_config = false;
  std::map<std::string, std::vector<std::string>> values;
  std::map<std::string, bool> flags;
};

void add_options(CLI::App& app, CommandLine& line) {
  app.add_option("--config", line.config_file,
                 "TOML file: KEY = VALUE, with the names of the flags as keys")
      ->envname("CATGS_CONFIG")
      ->option_text("FILE");
  app.add_flag("--print-config", line.print_config,
               "Print the settings in force with their sources, check them and exit; opens none of "
               "the files that they name");
  const ServerConfig defaults;
  for (const auto& setting : settings()) {
    // Scenes may also stand without their flag: catgs-server hall.ply
    const std::string name = "--" + setting.name + (setting.name == "scene" ? ",scenes" : "");
    if (setting.kind == Setting::Kind::flag) {
      app.add_flag(name, line.flags[setting.name], setting.help);
      continue;
    }
    const std::string value = setting.get(defaults);
    const bool has_default = value != "\"\"" && value != "[]";
    auto* option = app.add_option(name, line.values[setting.name],
                                  has_default ? setting.help + " [" + value + "]" : setting.help)
                       ->option_text(setting.value_name);
    // Only --scene takes all words behind it, for what follows another value is a scene.
    if (setting.name == "scene")
      option->option_text(setting.value_name + "...");
    else
      option->allow_extra_args(false);
    if (setting.kind != Setting::Kind::list)
      option->expected(1)->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  }
}

ServerConfig effective_config(const CommandLine& line, ConfigSources& sources) {
  ServerConfig config;
  if (!line.config_file.empty()) apply_toml(line.config_file, config, sources);
  apply_environment([](const char* name) { return std::getenv(name); }, config, sources);
  for (const auto& setting : settings()) {
    const auto values = line.values.find(setting.name);
    if (values != line.values.end() && !values->second.empty())
      apply_flag(setting, values->second, config, sources);
    const auto flag = line.flags.find(setting.name);
    if (flag != line.flags.end() && flag->second) apply_flag(setting, {"true"}, config, sources);
  }
  return config;
}

std::vector<std::string> variable_names() {
  std::vector<std::string> names;
  for (char** variable = environ; *variable; ++variable) {
    const std::string_view text = *variable;
    names.emplace_back(text.substr(0, text.find('=')));
  }
  return names;
}

int serve(const CommandLine& line) {
  ConfigSources sources;
  const ServerConfig config = effective_config(line, sources);
  if (line.print_config) std::cout << print_config(config, sources);
  set_up_log(config.log_format, config.log_level);
  validate(config, sources);
  if (const std::string unknown = unknown_variables(variable_names()); !unknown.empty())
    log_warning({.event = "unknown_setting"},
                "the environment has variables that are no settings: {}", unknown);
  if (line.print_config) return exit_ok;
  Server server(config);
  server.run();
  return exit_ok;
}

int run(int argc, char** argv) {
  bound_heaps();
  CLI::App app("Streams 3D Gaussian Splatting scenes to browsers.", "catgs-server");
  app.set_version_flag("--version", build_version);
  app.failure_message(failure_text);
  CommandLine line;
  add_options(app, line);
  int exit_code = exit_ok;
  add_selftest_command(app, exit_code);
  add_token_command(app, exit_code);
  app.footer(  // behind the commands, which would take it over
      "Give a flag once for each folder, site or network.\n"
      "Flags override CATGS_<NAME> variables, and these override --config FILE (TOML).\n"
      "Exit codes: 0 ended as asked, 1 failed (also when a required GPU cannot be used),\n"
      "2 bad usage, scene or configuration.\n"
      "Example: catgs-server synth:city:300000");
  try {
    parse_command_line(app, argc, argv);
    return app.get_subcommands().empty() ? serve(line) : exit_code;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? exit_ok : exit_usage;
  } catch (const DevicesUnusable& error) {
    // This is a fault, not a usage error, even if no GPU is found. A lost GPU looks like one that
    // never existed, and a full one may become free. A supervisor loses nothing by trying again.
    log_failure("start_failed", error.what());
    return exit_failure;
  } catch (const InputError& error) {
    log_failure("start_failed", error.what());
    return exit_usage;
  } catch (const std::exception& error) {
    log_failure("failed", error.what());
    return exit_failure;
  }
}

}  // namespace
}  // namespace catgs

int main(int argc, char** argv) { return catgs::run(argc, argv); }
