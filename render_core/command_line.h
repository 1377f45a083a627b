#pragma once

#include <CLI/CLI.hpp>

namespace catgs {

/// app.parse() for every program of ours. Where CLI11 takes -5 for a huge unsigned number, or names
/// the words behind an unknown option before it, this throws InputError: the option, what is wrong
/// with it, the nearest one that there is. Everything else is as CLI11 has it.
void parse_command_line(CLI::App& app, int argc, const char* const* argv);

}  // namespace catgs
