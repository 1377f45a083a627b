#pragma once

#include <cstddef>
#include <cstdio>
#include <string>

#include <fmt/format.h>
#include <sys/wait.h>

namespace catgs::test {

/// What the program did.
struct Outcome {
  int exit_code = -1;
  std::string out;  // stdout and stderr together
};

/// Runs catgs-render with these arguments, as a shell reads them.
inline Outcome run(const std::string& arguments) {
  Outcome outcome;
  FILE* pipe = popen(fmt::format("{} {} 2>&1", CATGS_RENDER, arguments).c_str(), "r");
  if (pipe == nullptr) return outcome;
  char buffer[4096];
  for (std::size_t n = 0; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) {
    outcome.out.append(buffer, n);
  }
  outcome.exit_code = WEXITSTATUS(pclose(pipe));
  return outcome;
}

}  // namespace catgs::test
