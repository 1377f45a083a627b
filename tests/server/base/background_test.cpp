#include "server/base/background.h"

#include <atomic>
#include <future>
#include <thread>

#include <gtest/gtest.h>

#include "server/net/disk_jobs.h"

namespace catgs::test {
namespace {

using namespace std::chrono_literals;

constexpr Lane one{"one"}, other{"other"};

/// Copies share one event.
class Event {
 public:
  void happen() const { promise_->set_value(); }
  void wait() const { happened_.wait(); }

 private:
  std::shared_ptr<std::promise<void>> promise_ = std::make_shared<std::promise<void>>();
  std::shared_future<void> happened_ = promise_->get_future().share();
};

class BackgroundTest : public testing::Test {
 protected:
  /// Holds the lane's thread until go().
  Background::JobId hold(Priority priority = Priority::normal, const Lane& lane = one) {
    const Event begun;
    const auto id = jobs_.start(lane, priority, [go = go_, begun](const std::stop_token&) {
      begun.happen();
      go.wait();
    });
    begun.wait();
    return id;
  }
  auto note(std::string name) {
    return [this, name = std::move(name)](const std::stop_token&) { order_ += name; };
  }
  /// All jobs so far have ended.
  void wait_for_all(const Lane& lane = one) {
    const Event ended;
    while (jobs_.start(lane, Priority::low, [ended](const auto&) { ended.happen(); }) == 0)
      std::this_thread::yield();  // the lane is full
    ended.wait();
  }

  const Event go_;
  std::string order_;  // written by the lane's only thread
  std::atomic<int> cancelled_{0};
  const std::function<void()> count_ = [this] { ++cancelled_; };
  boost::asio::io_context io_;
  Background background_;
  Background::Jobs jobs_{background_, io_};
};

TEST_F(BackgroundTest, HigherPriorityRunsFirstAndEqualOnesRunInOrder) {
  hold();
  jobs_.start(one, Priority::low, note("low "));
  jobs_.start(one, Priority::normal, note("first "));
  const auto raised = jobs_.start(one, Priority::low, note("raised "));
  jobs_.start(one, Priority::high, note("high "));
  jobs_.start(one, Priority::normal, note("second "));
  jobs_.set_priority(raised, Priority::high);
  go_.happen();
  wait_for_all();
  EXPECT_EQ(order_, "high raised first second low ");
}

TEST_F(BackgroundTest, LanesDoNotWaitForEachOther) {
  hold();
  wait_for_all(other);
  go_.happen();
}

TEST_F(BackgroundTest, CancelledJobIsNotRunAndSaysSo) {
  hold();
  const auto id = jobs_.start(one, Priority::normal, note("cancelled"), count_);
  jobs_.cancel(id);
  EXPECT_EQ(cancelled_, 1);
  jobs_.cancel(id);
  go_.happen();
  wait_for_all();
  EXPECT_EQ(order_, "");
  EXPECT_EQ(cancelled_, 1);
}

TEST_F(BackgroundTest, CancelledJobIsStoppedWhileItRuns) {
  const Event begun;
  const auto id = jobs_.start(
      one, Priority::normal,
      [&](const std::stop_token& stop) {
        begun.happen();
        sleep_unless_stopped(1h, stop);
        throw_if_stopped(stop);
      },
      count_);
  begun.wait();
  jobs_.cancel(id);
  wait_for_all();
  EXPECT_EQ(cancelled_, 1);
}

TEST_F(BackgroundTest, WorkRunsAgainWhileItAsksForThat) {
  const Event third;
  int runs = 0;
  jobs_.start(one, Priority::normal, [&](const std::stop_token&) {
    if (++runs == 3) third.happen();
    return runs < 3 ? std::optional<Clock::duration>(1ms) : std::nullopt;
  });
  third.wait();
  wait_for_all();
  EXPECT_EQ(runs, 3);
}

TEST_F(BackgroundTest, DelayedJobHoldsNobodyUp) {
  const auto id = jobs_.start(one, Priority::high,
                              [](const auto&) { return std::optional<Clock::duration>(1h); });
  wait_for_all();
  jobs_.cancel(id);
}

TEST_F(BackgroundTest, LowJobStartsAnewAfterAHigherOne) {
  const Event begun, again;
  int runs = 0;
  jobs_.start(
      one, Priority::low,
      [&](const std::stop_token& stop) {
        order_ += "low ";
        if (++runs > 1) return again.happen();
        begun.happen();
        sleep_unless_stopped(1h, stop);
        throw_if_stopped(stop);
      },
      count_);
  begun.wait();
  jobs_.start(one, Priority::normal, note("normal "));
  again.wait();
  EXPECT_EQ(order_, "low normal low ");
  EXPECT_EQ(cancelled_, 0);
}

TEST_F(BackgroundTest, FailureEndsItsJobOnly) {
  jobs_.start(one, Priority::normal,
              [](const std::stop_token&) { throw std::runtime_error("no room"); });
  wait_for_all();
}

TEST_F(BackgroundTest, LaneHasABound) {
  hold();
  for (std::size_t i = 0; i < Background::most_waiting; ++i)
    EXPECT_NE(jobs_.start(one, Priority::normal, note("")), 0u);
  EXPECT_EQ(jobs_.start(one, Priority::high, note("refused"), count_), 0u);
  EXPECT_EQ(cancelled_, 1);
  EXPECT_NE(jobs_.start(other, Priority::normal, note("")), 0u);
  go_.happen();
  wait_for_all();
  EXPECT_EQ(order_, "");
}

TEST_F(BackgroundTest, ClosedOwnerFinishesOnlyWhatItHasBegun) {
  Background::Jobs others(background_);
  const Event begun;
  jobs_.start(one, Priority::normal, [&](const std::stop_token& stop) {
    begun.happen();
    go_.wait();
    order_ += stop.stop_requested() ? "stopped " : "finished ";
    return std::optional<Clock::duration>(0s);
  });
  begun.wait();
  jobs_.start(one, Priority::normal, note("dropped "));
  others.start(one, Priority::normal, note("other's "));
  jobs_.close();
  EXPECT_EQ(jobs_.start(one, Priority::normal, note("late ")), 0u);
  go_.happen();
  const Event ended;
  others.start(one, Priority::low, [ended](const std::stop_token&) { ended.happen(); });
  ended.wait();
  EXPECT_EQ(order_, "finished other's ");
}

TEST_F(BackgroundTest, EndOfAnOwnerStopsAndAwaitsItsJobs) {
  bool ended = false;
  {
    Background::Jobs mine(background_, io_);
    const Event begun;
    mine.start(one, Priority::normal, [&](const std::stop_token& stop) {
      begun.happen();
      sleep_unless_stopped(1h, stop);
      ended = true;
    });
    mine.start_then(
        one, Priority::normal, [](const auto&) { return 1; },
        [&](const auto&) { order_ += "told"; });
    begun.wait();
  }
  EXPECT_TRUE(ended);
  io_.run();
  EXPECT_EQ(order_, "");
}

TEST_F(BackgroundTest, SessionThreadGetsResultsFailuresAndCancellations) {
  std::string told;
  const auto tell = [&](const Finished<int>& finished) {
    told += finished.result ? std::to_string(*finished.result) : finished.error + ".";
  };
  jobs_.start_then(
      one, Priority::normal, [](const auto&) { return 7; }, tell);
  jobs_.start_then(
      one, Priority::normal, [](const auto&) -> int { throw std::runtime_error("no room"); }, tell);
  wait_for_all();
  hold();
  jobs_.cancel(jobs_.start_then(
      one, Priority::normal, [](const auto&) { return 8; }, tell));
  EXPECT_EQ(told, "") << "nobody runs the session thread";
  io_.run();
  EXPECT_EQ(told, "7no room..");
  go_.happen();
}

TEST_F(BackgroundTest, QuestionToTheSessionThreadEndsWithTheJob) {
  std::atomic<int> answer{0};
  jobs_.start(one, Priority::normal, [&](const std::stop_token& stop) {
    answer = ask_session_thread(io_, stop, [] { return 7; });
  });
  while (io_.poll() == 0) {
    io_.restart();
    std::this_thread::yield();
  }
  wait_for_all();
  EXPECT_EQ(answer, 7);

  io_.restart();
  bool asked = false;
  const Event begun;
  const auto id = jobs_.start(
      one, Priority::normal,
      [&](const std::stop_token& stop) {
        begun.happen();
        ask_session_thread(io_, stop, [&] { return asked = true; });
      },
      count_);
  begun.wait();
  jobs_.cancel(id);
  wait_for_all();
  io_.poll();
  EXPECT_FALSE(asked);
  EXPECT_EQ(cancelled_, 1);
}

struct Waiter : Wakeable {
  void service_woken() override {}
};

TEST_F(BackgroundTest, DiskIsNotAskedForThoseWhoHaveGone) {
  const auto waiter = std::make_shared<Waiter>();
  auto gone = std::make_shared<Waiter>();
  std::atomic<int> done{0};
  DiskJobs disk(background_, std::make_shared<LwsWaker>());
  for (std::size_t i = 0; i < lanes.disk.threads; ++i) hold(Priority::normal, lanes.disk);
  const std::function<int()> work = [&] { return ++done; };
  auto dropped = disk.run(work, gone);
  auto result = disk.run(work, waiter);
  gone.reset();
  go_.happen();
  EXPECT_EQ(result.get(), 1);
  disk.end();
  EXPECT_EQ(done, 1);
  EXPECT_FALSE(disk.run(work, waiter).valid()) << "it has ended";
}

}  // namespace
}  // namespace catgs::test
