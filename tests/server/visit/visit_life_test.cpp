// Which of a visit's times have run out.

#include "server/visit/visit_life.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

class VisitLifeTest : public testing::Test {
 protected:
  TimePoint now = TimePoint{} + 1h;
  VisitPolicy policy;
  VisitLife life{policy, now};
};

TEST_F(VisitLifeTest, WaitsForAHelloAndNotInTheQueue) {
  EXPECT_FALSE(life.hello_is_late(now + policy.hello_timeout - 1ms));
  EXPECT_TRUE(life.hello_is_late(now + policy.hello_timeout));
  life.enter(VisitState::queued);
  EXPECT_FALSE(life.hello_is_late(now + policy.hello_timeout));
}

TEST_F(VisitLifeTest, RestsOnceNobodyHasDoneAnythingForAWhile) {
  EXPECT_FALSE(life.rests(now + 10s)) << "nobody sees anything yet";
  life.enter(VisitState::live);
  life.note_activity(now);
  EXPECT_FALSE(life.rests(now + 499ms)) << "it may be about to begin";
  EXPECT_TRUE(life.rests(now + 500ms));
}

TEST_F(VisitLifeTest, WarnsOnceAndThenReleases) {
  life.note_activity(now);
  now += policy.idle_timeout - policy.idle_warning;
  EXPECT_FALSE(life.idle_message(now - 1ms));
  const auto warning = life.idle_message(now);
  ASSERT_TRUE(warning);
  EXPECT_FALSE(warning->fatal);
  EXPECT_THAT(warning->message, HasSubstr("30 s"));
  EXPECT_FALSE(life.idle_message(now + 1s));
  now += policy.idle_warning;
  ASSERT_TRUE(life.idle_message(now));
  EXPECT_TRUE(life.idle_message(now)->fatal);
  life.note_activity(now);
  EXPECT_TRUE(life.idle_message(now + policy.idle_timeout - 1ms)) << "it is warned anew";
}

TEST_F(VisitLifeTest, IsNeverReleasedWithoutATimeout) {
  policy.idle_timeout = 0ms;
  EXPECT_FALSE(life.idle_message(now + 1000h));
}

TEST_F(VisitLifeTest, IsKeptForALostClientThatMayComeBack) {
  life.enter(VisitState::live);
  life.pause(true);
  life.lose(now);
  EXPECT_TRUE(life.resumable());
  EXPECT_FALSE(life.on_show());
  EXPECT_FALSE(life.grace_is_over(now + 30s - 1ms));
  EXPECT_TRUE(life.grace_is_over(now + 30s));
  life.resume(now + 20s);
  EXPECT_TRUE(life.on_show()) << "a hidden page that comes back is asked anew";
  EXPECT_FALSE(life.grace_is_over(now + 1h));
}

}  // namespace
}  // namespace catgs
