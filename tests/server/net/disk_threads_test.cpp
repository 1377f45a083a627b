#include "server/net/disk_threads.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

struct Waiter : Wakeable {
  void service_woken() override {}
};

TEST(DiskThreads, TakeSoMuchWorkAndNoneOfThoseWhoHaveGone) {
  const auto waiter = std::make_shared<Waiter>();
  auto gone = std::make_shared<Waiter>();
  std::promise<void> go;
  const std::shared_future<void> may_go = go.get_future().share();
  std::atomic<int> done{0};
  std::vector<std::future<int>> results;
  {
    DiskThreads threads(std::make_shared<LwsWaker>());
    const std::function<int()> work = [&] {
      may_go.wait();
      return ++done;
    };
    for (std::size_t i = 0; i < DiskThreads::most_waiting - 1; ++i)
      results.push_back(threads.run(work, waiter));
    results.push_back(threads.run(work, gone));
    for (const auto& result : results) EXPECT_TRUE(result.valid());
    EXPECT_FALSE(threads.run(work, waiter).valid());
    gone.reset();
    go.set_value();
    EXPECT_GT(results.front().get(), 0);
  }
  EXPECT_EQ(done, static_cast<int>(DiskThreads::most_waiting) - 1);
}

}  // namespace
}  // namespace catgs
