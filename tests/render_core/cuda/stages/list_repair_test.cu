// The order of lists, against a sort.

#include <algorithm>
#include <random>

#include "render_core/cuda/list_repair.cuh"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

/// Lists of several lengths, in an order that is nearly that of depth. Some depths are equal.
class ListRepairStage : public StageTest {
 protected:
  ListRepairStage() : shape_(picture_shape({4 * tile_side_px, 3 * tile_side_px})) {
    std::mt19937 random(5);
    for (const std::uint32_t length :
         {0u, 1u, 31u, 33u, 65u, 100u, 511u, 513u, 543u, 1024u, 5000u, 20'000u}) {
      const auto first = static_cast<std::uint32_t>(entries_.size());
      for (std::uint32_t i = 0; i < length; ++i) {
        depths_.push_back(static_cast<float>((i + random() % 30) / 3));
        entries_.push_back({first + i, static_cast<std::uint32_t>(random())});
      }
      ranges_.push_back(make_uint2(first, first + length));
    }
  }

  std::vector<TileEntry> repaired(const std::uint32_t* reach, int times = 1) const {
    const auto range = upload(ranges_);
    const auto depth = upload(depths_);
    const auto entries = upload(entries_);
    const Stream stream;
    for (int k = 0; k < times; ++k)
      launch_list_repair({.shape = shape_,
                          .range = range.get(),
                          .reach = reach,
                          .splat_depth = depth.get(),
                          .entries = entries.get()},
                         stream.get());
    return fetch(entries.get(), entries_.size());
  }

  /// The entries, sorted from the start of each list for `length` entries.
  [[nodiscard]] std::vector<TileEntry> sorted(std::uint32_t length) const {
    std::vector<TileEntry> expected = entries_;
    for (const uint2 range : ranges_)
      std::stable_sort(expected.begin() + range.x,
                       expected.begin() + std::min(range.x + length, range.y),
                       [&](const TileEntry& a, const TileEntry& b) {
                         return depths_[a.slot] < depths_[b.slot];
                       });
    return expected;
  }

  static void expect_same(const std::vector<TileEntry>& found,
                          const std::vector<TileEntry>& expected) {
    for (std::size_t i = 0; i < found.size(); ++i) {
      ASSERT_EQ(found[i].slot, expected[i].slot) << i;
      ASSERT_EQ(found[i].blocks, expected[i].blocks) << i;
    }
  }

  FrameShape shape_;
  std::vector<float> depths_;
  std::vector<TileEntry> entries_;
  std::vector<uint2> ranges_;
};

TEST_F(ListRepairStage, ListsAreSortedAndKeepTheOrderOfEqualDepths) {
  expect_same(repaired(nullptr), sorted(20'000));
}

TEST_F(ListRepairStage, EntriesFarBeyondTheLastReachAreLeftAlone) {
  const auto reach = upload(std::vector<std::uint32_t>(ranges_.size(), 400));
  expect_same(repaired(reach.get()), sorted(400 + 100 + 128));
}

TEST_F(ListRepairStage, EntriesFarFromTheirOrderComeCloserEachTime) {
  for (const uint2 range : ranges_)
    for (std::uint32_t i = range.x; i < range.y; ++i)
      depths_[i] = static_cast<float>((range.y - i) % 200 + (i - range.x) / 200 * 200);
  // 200 entries in reverse: an entry goes at least 32 nearer in each repair.
  expect_same(repaired(nullptr, 8), sorted(20'000));
}

}  // namespace
}  // namespace catgs::cuda::stages
