#pragma once

#include <string>

#include <fmt/format.h>

#include "tests/support/run_command.h"

namespace catgs::test {

/// Runs catgs-render with these arguments.
inline Outcome run(const std::string& arguments) {
  return run_command(fmt::format("{} {}", CATGS_RENDER, arguments));
}

}  // namespace catgs::test
