#pragma once

#include <CLI/CLI.hpp>

namespace catgs {

/// app.parse() for every program of ours. Where CLI11 takes -5 for a huge unsigned number, names
/// the words behind an unknown option before it, or says of an unknown command that one is
/// required, this throws InputError: the word, what is wrong with it, the nearest one that there
/// is. Everything else is as CLI11 has it.
void parse_command_line(CLI::App& app, int argc, const char* const* argv);

}  // namespace catgs
