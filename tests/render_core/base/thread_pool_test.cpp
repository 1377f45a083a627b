#include "render_core/base/thread_pool.h"

#include <algorithm>
#include <atomic>
#include <latch>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <sched.h>

namespace catgs {
namespace {

TEST(ThreadPool, LoopCallsEveryIndexOnce) {
  ThreadPool pool(3);
  for (const std::size_t count : {0u, 1u, 2u, 1000u}) {
    std::vector<std::atomic<int>> calls(count);
    pool.parallel_for(count, [&](std::size_t i) { calls[i].fetch_add(1); });
    for (const auto& c : calls) EXPECT_EQ(c.load(), 1);
  }
}

TEST(ThreadPool, LoopsRunInsideTasks) {
  ThreadPool pool(2);
  std::atomic<std::size_t> sum{0};
  std::latch done(8);
  for (int task = 0; task < 8; ++task) {
    pool.submit([&] {
      pool.parallel_for(100, [&](std::size_t i) { sum += i; });
      done.count_down();
    });
  }
  done.wait();
  EXPECT_EQ(sum.load(), 8u * 4950u);
}

TEST(ThreadPool, LoopRethrowsTheFirstException) {
  for (const int threads : {1, 3}) {
    ThreadPool pool(threads);
    std::atomic<int> calls{0};
    const auto loop = [&] {
      pool.parallel_for(100000, [&](std::size_t i) {
        ++calls;
        if (i == 10) throw std::runtime_error("tenth");
      });
    };
    EXPECT_THROW(loop(), std::runtime_error);
    if (threads == 1) {
      EXPECT_EQ(calls.load(), 11);
    }
    pool.parallel_for(10, [&](std::size_t) { calls = 0; });  // the pool lives on
    EXPECT_EQ(calls.load(), 0);
  }
}

TEST(ThreadPool, DestructorFinishesSubmittedTasks) {
  std::atomic<int> ran{0};
  {
    ThreadPool pool(2);
    for (int i = 0; i < 50; ++i) pool.submit([&] { ++ran; });
  }
  EXPECT_EQ(ran.load(), 50);
}

TEST(ThreadPool, AsManyTasksRunAsItIsGivenThreads) {
  ThreadPool pool(1);
  pool.set_threads(3);
  std::latch all_run(3), ended(3);
  for (int task = 0; task < 3; ++task)
    pool.submit([&] {
      all_run.arrive_and_wait();
      ended.count_down();
    });
  ended.wait();

  pool.set_threads(1);
  std::atomic<int> running{0}, most{0};
  std::latch done(30);
  for (int task = 0; task < 30; ++task)
    pool.submit([&] {
      most = std::max(most.load(), ++running);
      std::this_thread::yield();
      --running;
      done.count_down();
    });
  done.wait();
  EXPECT_EQ(most.load(), 1);
}

TEST(ThreadPool, HasAThreadForEachProcessorThatItMayUse) {
  cpu_set_t before;
  ASSERT_EQ(sched_getaffinity(0, sizeof(before), &before), 0);
  cpu_set_t one;
  CPU_ZERO(&one);
  int cpu = 0;
  while (!CPU_ISSET(cpu, &before)) ++cpu;
  CPU_SET(cpu, &one);
  ASSERT_EQ(sched_setaffinity(0, sizeof(one), &one), 0);
  const int threads = ThreadPool(0).threads();
  ASSERT_EQ(sched_setaffinity(0, sizeof(before), &before), 0);
  EXPECT_EQ(threads, 1);
  EXPECT_EQ(ThreadPool(0).threads(), CPU_COUNT(&before));
}

}  // namespace
}  // namespace catgs
