#include "render_core/scene/formats/load_context.h"

#include <barrier>
#include <future>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace catgs {
namespace {

TEST(LoadContext, ProgressEndsAtOneWhicheverThreadEndsLast) {
  const auto loading_thread = std::this_thread::get_id();
  std::promise<void> reported;
  std::vector<double> progress;
  ThreadPool pool(2);
  const LoadContext context(pool, [&](double fraction) {
    if (progress.empty()) reported.set_value();
    progress.push_back(fraction);
  });
  std::barrier each_has_one(2);
  context.for_blocks(2, 1, [&](std::size_t, std::size_t) {
    each_has_one.arrive_and_wait();
    if (std::this_thread::get_id() != loading_thread) reported.get_future().wait();
  });
  EXPECT_THAT(progress, testing::ElementsAre(0.5, 1.0));
}

}  // namespace
}  // namespace catgs
