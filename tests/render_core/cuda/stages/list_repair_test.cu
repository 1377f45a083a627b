// Order within runs of lists, against a sort of the same runs.

#include <algorithm>
#include <random>

#include "render_core/cuda/list_repair.cuh"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

constexpr std::uint32_t run = 64, half_run = 32;

/// Lists of several lengths, in an order that is nearly that of depth. Some depths are equal.
class ListRepairStage : public StageTest {
 protected:
  ListRepairStage() : shape_(picture_shape({4 * tile_side_px, 3 * tile_side_px})) {
    std::mt19937 random(5);
    for (const std::uint32_t length :
         {0u, 1u, 31u, 33u, 64u, 65u, 100u, 500u, 5000u, 7u, 96u, 20'000u}) {
      const auto first = static_cast<std::uint32_t>(entries_.size());
      for (std::uint32_t i = 0; i < length; ++i) {
        depths_.push_back(static_cast<float>((i + random() % 24) / 3));
        entries_.push_back({first + i, static_cast<std::uint32_t>(random())});
      }
      ranges_.push_back(make_uint2(first, first + length));
    }
  }

  std::vector<TileEntry> repaired(bool shifted, const std::uint32_t* reach) const {
    const auto range = upload(ranges_);
    const auto depth = upload(depths_);
    const auto entries = upload(entries_);
    const Stream stream;
    launch_list_repair({.shape = shape_,
                        .range = range.get(),
                        .reach = reach,
                        .splat_depth = depth.get(),
                        .shifted = shifted,
                        .entries = entries.get()},
                       stream.get());
    return fetch(entries.get(), entries_.size());
  }

  FrameShape shape_;
  std::vector<float> depths_;
  std::vector<TileEntry> entries_;
  std::vector<uint2> ranges_;
};

TEST_F(ListRepairStage, RunsAreSortedAndKeepTheOrderOfEqualDepths) {
  for (const bool shifted : {false, true}) {
    std::vector<TileEntry> expected = entries_;
    for (const uint2 range : ranges_) {
      for (std::uint32_t first = range.x + (shifted ? half_run : 0); first < range.y; first += run)
        std::stable_sort(expected.begin() + first,
                         expected.begin() + std::min(first + run, range.y),
                         [&](const TileEntry& a, const TileEntry& b) {
                           return depths_[a.slot] < depths_[b.slot];
                         });
    }
    const std::vector<TileEntry> found = repaired(shifted, nullptr);
    for (std::size_t i = 0; i < found.size(); ++i) {
      ASSERT_EQ(found[i].slot, expected[i].slot) << i;
      ASSERT_EQ(found[i].blocks, expected[i].blocks) << i;
    }
  }
}

TEST_F(ListRepairStage, EntriesFarBeyondTheLastReachAreLeftAlone) {
  const auto reach = upload(std::vector<std::uint32_t>(ranges_.size(), 100));
  const std::vector<TileEntry> found = repaired(false, reach.get());
  for (const uint2 range : ranges_) {
    for (std::uint32_t i = range.x + 400; i < range.y; ++i) ASSERT_EQ(found[i].slot, i);
    const auto sorted = found.begin() + range.x;
    EXPECT_TRUE(std::is_sorted(
        sorted, sorted + std::min(range.y - range.x, run),
        [&](const TileEntry& a, const TileEntry& b) { return depths_[a.slot] < depths_[b.slot]; }));
  }
}

}  // namespace
}  // namespace catgs::cuda::stages
