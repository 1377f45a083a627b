#include "server/frame_path.h"

#include "tests/server/visit/sessions_fixture.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

struct FramePathTest : SessionsTest {
  FramePathTest() {
    options.max_sessions = options.max_sessions_per_address = 100;
    options.policy.still_after = 1h;  // nothing is drawn but for a pose
  }
  /// Everybody has a picture, nothing is due any more, and no tick comes from here on.
  void settle() {
    move_on(1);
    sessions->stop_timer();
    do {
      for (Visitor& visitor : clients) acknowledge(visitor);
      frame_path->asked.clear();
      run_for(100ms);
    } while (!frame_path->asked.empty());
  }
};

TEST_F(FramePathTest, APoseLeadsToAPictureThatIsSeen) {
  start();
  Visitor& visitor = join();
  settle();
  const auto seen = [&] {
    return metrics.motion_to_photon_seconds.Collect().histogram.sample_count;
  };
  const auto before = seen();
  const std::size_t frames_before = visitor.connection->frames.size();
  move(visitor);
  run_until([&] { return visitor.connection->frames.size() > frames_before; });
  EXPECT_EQ(metrics.poses_received.Value(), static_cast<double>(visitor.poses));
  acknowledge(visitor);
  run_until([&] { return seen() > before; });
}

TEST_F(FramePathTest, AMessageAsksNoOtherVisit) {
  start();
  for (int i = 0; i < 40; ++i) join();
  settle();
  Visitor& visitor = clients[7];
  const std::size_t frames_before = visitor.connection->frames.size();
  move(visitor);
  run_until([&] { return visitor.connection->frames.size() > frames_before; });
  ASSERT_EQ(frame_path->asked.size(), 1u);
  EXPECT_LE(frame_path->asked.begin()->second, 2) << "once for the pose, once for the frame";
}

}  // namespace
}  // namespace catgs::test
