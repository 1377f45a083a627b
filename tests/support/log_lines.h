#pragma once

#include <functional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include "server/base/log.h"

namespace catgs::test {

/// The lines that are written while `log` logs.
inline std::vector<std::string> lines_of(std::string_view format, std::string_view level,
                                         const std::function<void()>& log) {
  const auto before = spdlog::default_logger();
  testing::internal::CaptureStderr();
  set_up_log(format, level);
  log();
  spdlog::default_logger()->flush();
  std::istringstream text(testing::internal::GetCapturedStderr());
  spdlog::drop("catgs-server");
  spdlog::set_default_logger(before);
  std::vector<std::string> all;
  for (std::string line; std::getline(text, line);) all.push_back(line);
  return all;
}

}  // namespace catgs::test
