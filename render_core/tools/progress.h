#pragma once

#include <chrono>
#include <string>
#include <string_view>

namespace catgs {

/// One line of progress on the terminal, rewritten in place and erased at the end. Silent when
/// stderr is not a terminal or `quiet` is set. One thread at a time may call update().
class Progress {
 public:
  Progress(std::string_view label, bool quiet);
  ~Progress();  // erases the line
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `fraction` in 0…1; `note` is appended ("41.2 fps"). Redraws at most ten times a second.
  void update(double fraction, std::string_view note = {});

 private:
  std::string label_;
  bool enabled_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point last_draw_;
};

}  // namespace catgs
