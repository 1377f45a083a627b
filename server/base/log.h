#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "server/base/log_event.h"

namespace catgs {

/// Sets up spdlog's default logger on standard error. `format` is "human" or "json" (one object a
/// line with time, level, the facts of log_event.h, and message). `level` is debug, info, warn or
/// error. Secrets are never logged.
///
/// Unless the level is debug, at most 50 lines a second are written, with bursts of 500. Errors are
/// exempt, and refusals have a rate of their own. The number of omitted lines is logged at most
/// once a second. Logging never blocks on a stopped terminal, an unread pipe or a full disk. Lines
/// that standard error does not take at once are lost and counted. Lines are cut at 4,096 bytes.
void set_up_log(std::string_view format, std::string_view level);

/// Logs a warning about a stranger's input, which may come in any amount. At most 10 a second are
/// written, with bursts of 100, whatever else is logged. Any thread.
void log_refusal(const LogFacts& facts, const std::string& text);

/// Says why the program ends: as a line of the log where programs read that, else as command lines
/// do.
void log_failure(std::string_view event, const std::string& text);

/// The number of lines lost since the process began: over the rate, on a full disk or into an
/// unread pipe. Any thread.
[[nodiscard]] std::uint64_t log_lines_lost();

}  // namespace catgs
