#include "server/visit/admission_controller.h"

#include "tests/server/visit/sessions_fixture.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

using AdmissionControllerTest = SessionsTest;

TEST_F(AdmissionControllerTest, ABurstWaitsForWhatTheFirstOnesCost) {
  options.min_fps = 10;
  options.cpus = [] { return 2.0; };
  start();
  Visitor& first = join();
  Visitor& second = join();
  const Visitor& third = join();
  EXPECT_TRUE(first.connection->welcome && second.connection->welcome);
  EXPECT_TRUE(third.connection->waits);
  EXPECT_FALSE(third.connection->welcome);
  run_until([&] {
    move(first);
    return third.connection->welcome.has_value();
  });
  EXPECT_GE(first.connection->frames.size(), 8u) << "its frames were measured";
}

void wish_for_4k(v1::Hello& hello) {
  hello.set_viewport_width_px(3840);
  hello.set_viewport_height_px(2160);
  hello.mutable_settings()->set_max_fps(240);
}

/// Two GPUs, and as many processors as it takes.
struct MeasuredAdmission : SessionsTest {
  void start(float frame_ms) {
    devices = std::make_shared<DeviceSet>(std::vector<int>{0, 1});
    for (const int device : {0, 1}) devices->add(device);
    renderer = std::make_shared<PretendedRenderer>(devices);
    for (auto& ms : renderer->frame_ms) ms = frame_ms;
    scenes = OneScene(renderer);
    options.min_fps = 10;
    options.cpus = [] { return 1000.0; };
    SessionsTest::start();
  }
  /// Until it is known what frames cost.
  void measure() {
    move_until([&] { return metrics.gpu_budget_used.Value() > 0.0; });
  }
};

TEST_F(MeasuredAdmission, ARequestForTooManyPixelsGetsFewerAndDelaysNobody) {
  start(20.0f);
  join();
  measure();
  const auto greedy = join({}, "192.0.2.2", wish_for_4k).connection;
  const auto another = join({}, "192.0.2.2", wish_for_4k).connection;
  const auto honest = join().connection;
  ASSERT_TRUE(greedy->welcome && another->welcome && honest->welcome);
  EXPECT_LT(greedy->welcome->config().width_px(), 3840u);
  EXPECT_LT(another->welcome->config().width_px(), greedy->welcome->config().width_px());
  EXPECT_EQ(honest->welcome->config().width_px(), 160u);
}

TEST_F(MeasuredAdmission, SessionsAboveAnEqualShareAreScaledDownWhileOthersNeedIt) {
  start(300.0f);
  const auto greedy = join({}, "192.0.2.2", wish_for_4k).connection;
  EXPECT_EQ(greedy->welcome->config().width_px(), 3840u) << "nobody else is there";
  measure();
  EXPECT_TRUE(join().connection->welcome);
  move_until([&] { return greedy->config && greedy->config->width_px() < 3840u; });
  leave(1);
  move_until([&] { return greedy->config->width_px() == 3840u; });
}

void wish_for_a_frame_a_second(v1::Hello& hello) { hello.mutable_settings()->set_max_fps(1); }

TEST_F(MeasuredAdmission, ASessionWithoutRoomDoesNotBlockSmallerOnes) {
  start(90.0f);
  join();
  measure();
  join();
  ASSERT_TRUE(join().connection->waits);
  EXPECT_TRUE(join({}, "192.0.2.2", wish_for_a_frame_a_second).connection->welcome);
}

TEST_F(MeasuredAdmission, ALongWaitEndsOvertaking) {
  options.policy.overtaken_at_most = 0ms;
  start(90.0f);
  join();
  measure();
  join();
  const auto first = join().connection;
  const auto second = join({}, "192.0.2.2", wish_for_a_frame_a_second).connection;
  ASSERT_TRUE(first->waits && second->waits);
  leave(1);
  run_until([&] { return first->welcome && second->welcome; });
}

TEST_F(AdmissionControllerTest, NobodyWaitsWithoutEnd) {
  options.max_sessions = 1;
  options.policy.longest_wait = 100ms;
  start();
  join();
  const auto connection = join().connection;
  ASSERT_TRUE(connection->waits);
  run_until([&] { return connection->error.has_value(); });
  EXPECT_EQ(connection->error->code(), v1::Error::SERVER_FULL);
  EXPECT_THAT(connection->error->message(), HasSubstr("no place came free"));
}

TEST_F(AdmissionControllerTest, BudgetFollowsACpuQuotaThatChanges) {
  options.min_fps = 10;
  std::atomic<double> cpus{2.0};
  options.cpus = [&] { return cpus.load(); };
  start();
  join();
  move_until([&] { return metrics.cpu_budget_used.Value() > 0.0; });
  EXPECT_EQ(metrics.processors.Value(), 2.0);
  const double before = metrics.cpu_budget_used.Value();
  cpus = 0.02;
  move_until([&] { return metrics.processors.Value() == 0.02; });
  move_until([&] { return metrics.cpu_budget_used.Value() > before; });
}

TEST_F(AdmissionControllerTest, AWaitForMeasurementsIsTold) {
  options.min_fps = 10;
  options.cpus = [] { return 1.0; };
  options.max_queue = 1;
  start();
  join();
  EXPECT_TRUE(join().connection->waits);
  EXPECT_EQ(clients.back().connection->estimate_s, 3u);
  const Visitor& third = join();
  ASSERT_TRUE(third.connection->error);
  EXPECT_THAT(third.connection->error->message(), HasSubstr("1 wait for it: try again in 3 s"));
}

}  // namespace
}  // namespace catgs::test
