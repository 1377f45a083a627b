#include "render_core/base/radix_sort.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace catgs {
namespace {

TEST(RadixSorter, SortsStablyWithAnyNumberOfThreads) {
  std::uint64_t state = 5;
  std::vector<CodedIndex> data(50000);
  for (std::uint32_t i = 0; i < data.size(); ++i) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    data[i] = {(state >> 20) % 30000 << 25, i};
  }
  std::vector<CodedIndex> expected = data;
  std::ranges::stable_sort(expected, {}, &CodedIndex::key);
  for (const int threads : {1, 2, 7}) {
    ThreadPool pool(threads);
    RadixSorter sorter;
    std::vector<CodedIndex> sorted = data, scratch(data.size());
    sorter.sort(sorted, scratch, 44, pool);
    for (std::size_t i = 0; i < sorted.size(); ++i)
      ASSERT_EQ(sorted[i].value, expected[i].value) << threads << " threads, position " << i;
  }
}

}  // namespace
}  // namespace catgs
