#include "server/log.h"

#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "server/session/log_session.h"

namespace catgs {
namespace {

using testing::EndsWith;

/// The lines that a line about nobody, one about a session, and one after it make.
std::vector<std::string> lines(std::string_view format) {
  const auto before = spdlog::default_logger();
  testing::internal::CaptureStderr();
  set_up_log(format, "info");
  spdlog::info("first");
  {
    const LogSession about("1f2e3d4c");
    spdlog::warn("\xff \"quoted\"");
  }
  spdlog::info("last");
  spdlog::default_logger()->flush();
  std::istringstream text(testing::internal::GetCapturedStderr());
  spdlog::drop("catgs-server");
  spdlog::set_default_logger(before);
  std::vector<std::string> all;
  for (std::string line; std::getline(text, line);) all.push_back(line);
  return all;
}

TEST(Log, JsonLinesNameTheirSession) {
  const auto all = lines("json");
  ASSERT_EQ(all.size(), 3u);
  EXPECT_FALSE(nlohmann::json::parse(all[0]).contains("session"));
  const auto about = nlohmann::json::parse(all[1]);
  EXPECT_EQ(about.at("session"), "1f2e3d4c");
  EXPECT_EQ(about.at("level"), "warning");
  EXPECT_EQ(about.at("message"), "\ufffd \"quoted\"");
  EXPECT_FALSE(nlohmann::json::parse(all[2]).contains("session"));
}

TEST(Log, HumanLinesNameTheirSession) {
  const auto all = lines("human");
  ASSERT_EQ(all.size(), 3u);
  EXPECT_THAT(all[0], EndsWith("info first"));
  EXPECT_THAT(all[1], EndsWith("warning session 1f2e3d4c: \xff \"quoted\""));
  EXPECT_THAT(all[2], EndsWith("info last"));
}

}  // namespace
}  // namespace catgs
