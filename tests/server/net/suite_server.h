#pragma once

#include "tests/support/server_client.h"
#include "tests/support/test.h"

namespace catgs::test {

/// A server for the cases of one suite that change nothing for each other. It starts with the first
/// use, and ends with the suite.
class SuiteServer : public testing::EmptyTestEventListener {
 public:
  explicit SuiteServer(std::function<void(ServerConfig&)> change) : change_(std::move(change)) {
    testing::UnitTest::GetInstance()->listeners().Append(this);  // which deletes it
  }
  const RunningServer& get() {
    if (!server_) server_ = std::make_unique<RunningServer>(change_);
    return *server_;
  }

 private:
  void OnTestSuiteEnd(const testing::TestSuite&) override { server_.reset(); }

  const std::function<void(ServerConfig&)> change_;
  std::unique_ptr<RunningServer> server_;
};

/// As by default, with room for many sessions.
inline const RunningServer& shared_server() {
  static auto& server = *new SuiteServer([](ServerConfig& config) {
    config.max_sessions = 64;  // those that a case lost keep their slots for a while
  });
  return server.get();
}

}  // namespace catgs::test
