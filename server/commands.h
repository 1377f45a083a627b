#pragma once

#include "render_core/base/cli_fwd.h"

namespace catgs {

// Subcommands of catgs-server. Each parses into its own state and sets `exit_code` when it has run.
void add_selftest_command(CLI::App& app, int& exit_code);
void add_token_command(CLI::App& app, int& exit_code);

}  // namespace catgs
