#include "server/visit/client_connection.h"

#include "tests/server/visit/sessions_fixture.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

using ClientConnectionTest = SessionsTest;

TEST_F(ClientConnectionTest, TakesMessagesAtTheirRate) {
  start();
  const TimePoint start = Clock::now();
  Visitor& visitor = clients.emplace_back(Visitor{
      std::make_shared<OpenConnection>(), sessions->accept(std::make_shared<OpenConnection>())});
  for (int i = 0; i < 1200; ++i) move(visitor);
  EXPECT_EQ(metrics.poses_received.Value(), 1200.0);
  std::this_thread::sleep_for(250ms);
  for (int i = 0; i < 2000; ++i) move(visitor);
  const std::chrono::duration<double> elapsed = Clock::now() - start;
  EXPECT_GE(metrics.poses_received.Value(), 1200 + 150);
  EXPECT_LE(metrics.poses_received.Value(), 1201 + 600 * elapsed.count());
}

TEST_F(ClientConnectionTest, RefusesAFloodOnce) {
  start();
  auto connection = std::make_shared<OpenConnection>();
  Visitor& flooding = clients.emplace_back(Visitor{connection, sessions->accept(connection)});
  flooding.listener->on_flood();
  move(flooding);
  flooding.listener->on_flood();
  run_until([&] { return connection->closed.has_value(); });
  EXPECT_EQ(connection->closed, CloseCode::policy_violation);
  EXPECT_EQ(connection->error->code(), v1::Error::RATE_LIMITED);
  EXPECT_EQ(metrics.sessions_refused.Value(), 1.0);
  EXPECT_EQ(metrics.poses_received.Value(), 0.0);
}

}  // namespace
}  // namespace catgs::test
