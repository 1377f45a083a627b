#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace catgs {

/// Sets up spdlog's default logger on standard error. `format`: "human" or "json" (one object a
/// line: time, level, session where a line is about one, message); `level`: debug, info, warn,
/// error. Nothing secret is ever logged. Unless the level is debug, at most 50 lines a second are
/// written, and 500 at once; beside them errors, refusals at a rate of their own, and how many were
/// left out, once a second at most. Nobody waits for a terminal that was stopped, a pipe that
/// nobody reads or a full disk: what standard error does not take at once is lost and counted.
/// Lines are cut at 4,096 bytes.
void set_up_log(std::string_view format, std::string_view level);

/// A warning about what a stranger sent, who may send as much as they like: at most 10 a second
/// are written, and 100 at once, whatever else is logged. Any thread.
void log_refusal(const std::string& line);

/// Lines that are not in the log since the process began: there were too many, a disk was full, a
/// pipe not read. Any thread.
[[nodiscard]] std::uint64_t log_lines_lost();

}  // namespace catgs
