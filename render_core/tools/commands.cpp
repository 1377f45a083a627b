#include "render_core/tools/commands.h"

#include <CLI/CLI.hpp>

namespace catgs {

bool is_quiet(const CLI::App& command) {
  const CLI::App* app = &command;
  while (app->get_parent() != nullptr) app = app->get_parent();
  return app->get_option("--quiet")->count() > 0;
}

}  // namespace catgs
