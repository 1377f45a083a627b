#include "render_core/tools/commands.h"

#include <CLI/CLI.hpp>

#include "render_core/base/error.h"

namespace catgs {

bool is_quiet(const CLI::App& command) {
  const CLI::App* app = &command;
  while (app->get_parent() != nullptr) app = app->get_parent();
  return app->get_option("--quiet")->count() > 0;
}

void add_missing_benchmarks(CLI::App& app) {
  for (const char* name : {"bench", "compare", "paper", "trace"}) {
    CLI::App* command = app.add_subcommand(name, "Not in this build");
    command->prefix_command();  // its options are as unknown as itself
    command->group("Commands that measure, for builds with -DCATGS_BENCHMARKS=ON");
    command->parse_complete_callback([name] {  // before words that nobody knows are refused
      throw InputError(
          name, "", "is not in this build of catgs-render",
          "set -DCATGS_BENCHMARKS=ON in its build folder, with cmake, and build again");
    });
  }
}

}  // namespace catgs
