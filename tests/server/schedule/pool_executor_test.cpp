#include "server/schedule/pool_executor.h"

#include <future>
#include <utility>

#include <gtest/gtest.h>

namespace catgs {
namespace {

/// A View that holds its pool and takes until `may_end` to end, as one does whose device is busy.
class LastingView final : public View {
 public:
  LastingView(std::shared_ptr<ThreadPool> pool, std::shared_future<void> may_end,
              std::promise<std::thread::id> ended_on)
      : pool_(std::move(pool)), may_end_(std::move(may_end)), ended_on_(std::move(ended_on)) {}
  ~LastingView() override {
    may_end_.wait();
    ended_on_.set_value(std::this_thread::get_id());
  }
  RenderStatus render(const FrameRequest&, FrameView&) noexcept override { return {}; }
  [[nodiscard]] std::size_t memory_bytes() const override { return 0; }

 private:
  std::shared_ptr<ThreadPool> pool_;
  std::shared_future<void> may_end_;
  std::promise<std::thread::id> ended_on_;
};

TEST(PoolExecutor, AStreamEndsElsewhereAndBeforeTheExecutor) {
  std::promise<void> let_end;
  std::promise<std::thread::id> ended_on;
  std::future<std::thread::id> ended = ended_on.get_future();
  auto pool = std::make_shared<ThreadPool>(1);
  const std::weak_ptr<ThreadPool> watched = pool;
  auto executor = std::make_unique<PoolExecutor>(pool);
  auto stream = std::make_shared<Stream>();
  stream->view =
      std::make_unique<LastingView>(pool, let_end.get_future().share(), std::move(ended_on));
  pool.reset();

  executor->close(std::move(stream));  // does not wait, or this test never ends
  let_end.set_value();
  executor.reset();
  ASSERT_EQ(ended.wait_for(std::chrono::seconds(0)), std::future_status::ready);
  EXPECT_NE(ended.get(), std::this_thread::get_id());
  EXPECT_TRUE(watched.expired());  // joined here: a worker cannot join itself
}

TEST(PoolExecutor, AClientThatNeverOpenedAStreamClosesIt) {
  PoolExecutor executor(std::make_shared<ThreadPool>(2));
  for (int i = 0; i < 100; ++i) executor.close(std::make_shared<Stream>());
}

}  // namespace
}  // namespace catgs
