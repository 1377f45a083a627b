#pragma once

#include <cstdint>
#include <string_view>

namespace catgs {

/// Sets up spdlog's default logger on standard error. `format`: "human" or "json" (one object a
/// line: time, level, session where a line is about one, message); `level`: debug, info, warn,
/// error. Nothing secret is ever logged. Unless the level is debug, at most 50 lines a second are
/// written, and 500 at once; how many were left out is a line, too. Nobody waits for a terminal
/// that was stopped, a pipe that nobody reads or a full disk: what standard error does not take at
/// once is lost and counted. Lines are cut at 4,096 bytes.
void set_up_log(std::string_view format, std::string_view level);

/// Lines that were lost since the process began: a disk was full, a pipe not read. Any thread.
[[nodiscard]] std::uint64_t log_lines_lost();

}  // namespace catgs
