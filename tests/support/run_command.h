#pragma once

#include <cstddef>
#include <cstdio>
#include <string>

#include <sys/wait.h>

namespace catgs::test {

/// What a program did.
struct Outcome {
  int exit_code = -1;
  std::string out;  // stdout and stderr together
};

/// Runs a command as a shell reads it.
inline Outcome run_command(const std::string& command) {
  Outcome outcome;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return outcome;
  char buffer[4096];
  for (std::size_t n = 0; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) {
    outcome.out.append(buffer, n);
  }
  outcome.exit_code = WEXITSTATUS(pclose(pipe));
  return outcome;
}

}  // namespace catgs::test
