// catgs-render: the renderer without a server. Exit codes are documented in commands.h.
#include <cstdio>
#include <exception>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/base/build_info.h"
#include "render_core/base/command_line.h"
#include "render_core/base/error.h"
#include "render_core/base/printable.h"
#include "render_core/tools/commands.h"

namespace catgs {
namespace {

int run(int argc, char** argv) {
  CLI::App app("Inspects, renders and measures 3D Gaussian Splatting scenes.", "catgs-render");
  app.set_version_flag("--version", build_version);
  app.require_subcommand(1);
  app.fallthrough();
  bool quiet = false;  // read by is_quiet()
  app.add_flag("-q,--quiet", quiet, "Show no progress on the terminal");
  app.failure_message(failure_text);
  app.footer(
      "Exit codes: 0 done, 1 a requested check failed, 2 bad usage or input, 3 internal error.");

  add_convert_command(app);
  add_floors_command(app);
  add_frames_command(app);
  add_info_command(app);
  add_synth_command(app);
#if CATGS_BENCHMARKS
  add_bench_command(app);
  add_compare_command(app);
  add_paper_command(app);
  add_trace_command(app);
#else
  add_missing_benchmarks(app);
#endif

  try {
    parse_command_line(app, argc, argv);
    return 0;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : exit_bad_input;
  } catch (const CheckFailed& error) {
    fmt::print(stderr, "catgs-render: {}\n", printable(error.what()));
    return exit_check_failed;
  } catch (const InputError& error) {
    fmt::print(stderr, "catgs-render: {}\n", printable(error.what()));
    return exit_bad_input;
  } catch (const std::exception& error) {
    fmt::print(stderr, "catgs-render: internal error: {}\n", printable(error.what()));
    return exit_internal;
  }
}

}  // namespace
}  // namespace catgs

int main(int argc, char** argv) { return catgs::run(argc, argv); }
