#pragma once

#include <string>

#include "render_core/base/cli_fwd.h"

namespace catgs {

/// app.parse() for all our programs, with better errors where CLI11's mislead. CLI11 takes -5 for a
/// huge unsigned number, names the words behind an unknown option before the option, and answers an
/// unknown command with "a command is required". Here InputError names the word, what is wrong with
/// it, and the nearest known one. Everything else is as in CLI11.
void parse_command_line(CLI::App& app, int argc, const char* const* argv);

/// For CLI::App::failure_message(): `PROGRAM: what is wrong`, and whose --help tells more.
std::string failure_text(const CLI::App* app, const CLI::Error& error);

}  // namespace catgs
