#pragma once

#include <stdexcept>

#include "render_core/base/cli_fwd.h"

namespace catgs {

// Subcommands of catgs-render. Each lives in its own file, adds itself to the program and runs from
// its CLI11 callback. main.cpp turns exceptions into a message and an exit code:
//
//   0  done
//   1  a check that was asked for failed     CheckFailed
//   2  bad usage or bad input                CLI::ParseError, InputError
//   3  anything else, a bug or a full disk   any other exception

/// A check that the user asked for has failed. The message names it, with both values.
struct CheckFailed : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline constexpr int exit_check_failed = 1;
inline constexpr int exit_bad_input = 2;
inline constexpr int exit_internal = 3;

/// The program's --quiet, which every subcommand obeys.
bool is_quiet(const CLI::App& command);

void add_convert_command(CLI::App& app);
void add_floors_command(CLI::App& app);
void add_frames_command(CLI::App& app);
void add_info_command(CLI::App& app);
void add_synth_command(CLI::App& app);

// The commands that measure, in builds with CATGS_BENCHMARKS.
void add_bench_command(CLI::App& app);
void add_compare_command(CLI::App& app);
void add_paper_command(CLI::App& app);
void add_trace_command(CLI::App& app);
/// A subcommand of `trace`, which adds it.
void add_trace_windows_command(CLI::App& trace);
/// In other builds each of these says how to build it.
void add_missing_benchmarks(CLI::App& app);

}  // namespace catgs
