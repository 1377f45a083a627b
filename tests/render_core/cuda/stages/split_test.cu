// Splitting tiles into tasks and queueing them, against the rule of split.cuh on the host.

#include <map>
#include <random>
#include <span>

#include "render_core/cuda/split.cuh"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

constexpr std::uint32_t unknown_reach = ~0u;
constexpr std::uint32_t most_slices_per_tile = 1024;

struct Tile {
  std::uint32_t begin, listed, reach;  // `reach`: in the last frame
};

/// How split.cuh cuts a tile.
struct Cut {
  std::uint32_t expected, slices, reserve;
};

Cut cut_of(const Tile& tile, std::uint32_t length) {
  Cut cut{tile.listed, 1, 0};
  if (tile.reach < tile.listed)
    cut.expected = std::min(tile.listed, tile.reach + tile.reach / 4 + 2 * warp_size);
  const auto parts = [](std::uint32_t entries, std::uint32_t each) {
    return std::min((entries + each - 1) / each, most_slices_per_tile);
  };
  if (cut.expected > 2 * length) cut.slices = parts(cut.expected, length);
  const std::uint32_t rest = tile.listed - cut.expected;
  if (rest > 4 * length) cut.reserve = parts(rest, 2 * length);
  return cut;
}

/// What the stage wrote.
struct Drawn {
  FrameCounts counts;
  std::vector<BlendTask> tasks;
  std::vector<uint2> tile_slices;
  std::vector<std::uint32_t> queue, reach;
  std::vector<float> transmittance;
};

class SplitStage : public StageTest {
 protected:
  void SetUp() override {
    StageTest::SetUp();
    std::mt19937_64 random(21);
    std::uint32_t begin = 0;
    for (int t = 0; t < 40 * 25; ++t) {
      const auto below = [&](std::uint32_t n) { return static_cast<std::uint32_t>(random() % n); };
      const std::uint32_t kind = below(10);
      const std::uint32_t listed = kind == 0 ? 0 : kind < 8 ? below(600) : below(30'000);
      const std::uint32_t reach = below(3) == 0 ? unknown_reach : below(listed + 100);
      tiles_.push_back({begin, listed, reach});
      begin += listed;
    }
    shape_ = picture_shape({40 * tile_side_px, 25 * tile_side_px});
    shape_.list_bound = begin;
  }

  Drawn split(std::uint32_t slice_bound, std::uint32_t mean) {
    shape_.slice_bound = slice_bound;
    std::vector<uint2> ranges;
    std::vector<std::uint32_t> last_reach;
    for (const Tile& tile : tiles_) {
      ranges.push_back(make_uint2(tile.begin, tile.begin + tile.listed));
      last_reach.push_back(tile.reach);
    }
    const auto range = upload(ranges);
    const auto last = upload(last_reach);
    const auto reach = upload(std::vector<std::uint32_t>(tiles_.size(), ~0u));
    const auto tasks = upload(std::vector<BlendTask>(task_bound(shape_)));
    const auto slices = upload(std::vector<uint2>(tiles_.size()));
    const auto queue = upload(std::vector<std::uint32_t>(queue_bound(shape_)));
    const auto transmittance =
        upload(std::vector<float>(std::size_t{slice_bound} * parts_per_tile + 1));
    const auto counts = upload(std::vector<FrameCounts>(1));
    const Stream stream;
    launch_split(
        {.shape = shape_,
         .range = range.get(),
         .last_reach = {.reach = last.get(), .tiles_x = shape_.tiles_x, .tiles_y = shape_.tiles_y},
         .reach = reach.get(),
         .tasks = tasks.get(),
         .tile_slices = slices.get(),
         .queue = queue.get(),
         .slice_transmittance = transmittance.get(),
         .counts = counts.get(),
         .mean_list = mean,
         .split = true},
        stream.get());
    return {fetch(counts.get(), 1)[0],          fetch(tasks.get(), task_bound(shape_)),
            fetch(slices.get(), tiles_.size()), fetch(queue.get(), queue_bound(shape_)),
            fetch(reach.get(), tiles_.size()),  fetch(transmittance.get(), transmittance.size())};
  }

  std::vector<Tile> tiles_;
  FrameShape shape_;
};

/// The tasks of a tile.
std::span<const BlendTask> tasks_of(const Drawn& drawn, const FrameShape& shape, std::uint32_t t) {
  const uint2 slices = drawn.tile_slices[t];
  if (slices.y == 0) return std::span(drawn.tasks).subspan(t, 1);
  return std::span(drawn.tasks).subspan(shape.tiles() + slices.x, slices.y);
}

/// The class of each task that is queued.
std::map<std::uint32_t, int> queue_of(const Drawn& drawn, const FrameShape& shape) {
  std::map<std::uint32_t, int> class_of;
  for (int c = 0; c < queue_classes; ++c)
    for (std::uint32_t k = 0; k < drawn.counts.queued[c]; ++k)
      EXPECT_TRUE(
          class_of.emplace(drawn.queue[static_cast<std::uint32_t>(c) * shape.tiles() + k], c)
              .second)
          << "queued twice";
  return class_of;
}

/// Every entry of every tile is in one task, and every task is queued once.
void expect_complete(const Drawn& drawn, const FrameShape& shape, const std::vector<Tile>& tiles) {
  const std::map<std::uint32_t, int> class_of = queue_of(drawn, shape);
  Mismatches whole("split: tiles whose tasks are not their lists", 0.0);
  std::size_t tasks = 0;
  for (std::uint32_t t = 0; t < tiles.size(); ++t) {
    const auto of_tile = tasks_of(drawn, shape, t);
    tasks += of_tile.size();
    std::uint32_t at = tiles[t].begin;
    bool complete = true;
    for (std::size_t s = 0; s < of_tile.size(); ++s) {
      const BlendTask& task = of_tile[s];
      const auto index = static_cast<std::uint32_t>(&task - drawn.tasks.data());
      complete = complete && task.tile == t && task.first == at && task.slice == s &&
                 task.slices == of_tile.size() && class_of.contains(index);
      at = task.last;
    }
    whole.add(!complete || at != tiles[t].begin + tiles[t].listed);
  }
  EXPECT_EQ(class_of.size(), tasks);
}

TEST_F(SplitStage, CutsTilesByTheRule) {
  constexpr std::uint32_t mean = 300;
  const std::uint32_t length = slice_length(mean);
  const Drawn drawn = split(100'000, mean);
  expect_complete(drawn, shape_, tiles_);
  Mismatches cuts("split: tiles that are cut in another way", 0.0);
  Mismatches classes("split: tasks in another class of the queue", 0.0);
  const std::map<std::uint32_t, int> class_of = queue_of(drawn, shape_);
  std::uint64_t expected_entries = 0, wanted = 0;
  std::uint32_t longest = 0;
  for (std::uint32_t t = 0; t < tiles_.size(); ++t) {
    const Tile& tile = tiles_[t];
    const Cut cut = cut_of(tile, length);
    expected_entries += cut.expected;
    longest = std::max(longest, tile.listed);
    const std::uint32_t slices = cut.slices + cut.reserve;
    wanted += slices > 1 ? slices : 0;
    const auto tasks = tasks_of(drawn, shape_, t);
    bool same = tasks.size() == slices && drawn.reach[t] == 0;
    if (same && cut.reserve > 0) same = tasks[cut.slices].first == tile.begin + cut.expected;
    for (std::uint32_t s = 0; same && s < slices; ++s) {
      const bool last = s >= cut.slices || s + 1 >= queue_classes;
      const int expected_class = last ? queue_classes - 1 : static_cast<int>(s);
      classes.add(class_of.at(static_cast<std::uint32_t>(&tasks[s] - drawn.tasks.data())) !=
                  expected_class);
    }
    cuts.add(!same);
  }
  EXPECT_EQ(drawn.counts.expected_entries, expected_entries);
  EXPECT_EQ(drawn.counts.wanted_slices, wanted);
  EXPECT_EQ(drawn.counts.allocated_slices, wanted);
  EXPECT_EQ(drawn.counts.list_max, longest);
  EXPECT_GT(wanted, 100u);  // the case is the one meant
  Mismatches clear("split: parts of slices that begin without their transmittance", 0.0);
  for (std::size_t i = 0; i < wanted * parts_per_tile; ++i)
    clear.add(drawn.transmittance[i] != 1.0f);
}

TEST_F(SplitStage, LosesNothingWhereSlicesFindNoRoom) {
  for (const std::uint32_t room : {0u, 50u, 400u}) {
    const Drawn drawn = split(room, 300);
    expect_complete(drawn, shape_, tiles_);
    EXPECT_LE(drawn.counts.allocated_slices, room);
    EXPECT_GT(drawn.counts.wanted_slices, room);
  }
}

}  // namespace
}  // namespace catgs::cuda::stages
