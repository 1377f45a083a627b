// What culling and the lists leave out behind the limits of parts, against every pixel.

#include <map>
#include <random>

#include "render_core/math/ellipse-inl.h"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

constexpr glm::ivec2 size_px{160, 96};

/// Gaussians in view of a camera, and a limit of depth for each part of the picture.
class HiddenStage : public StageTest {
 protected:
  HiddenStage() : staged_(Listed::now, 3000, size_px) {
    staged_.settings.pipeline = Pipeline::catgs;
    const FrameShape shape = picture_shape(size_px);
    std::mt19937_64 random(61);
    // Regions of near limits, so that whole splats are behind them, with some far limits in
    // between.
    for (std::uint32_t t = 0; t < shape.tiles(); ++t) {
      const bool open = t % 4 == 3;
      for (int part = 0; part < parts_per_tile; ++part)
        part_limit_.push_back(open || random() % 20 == 0 ? std::numeric_limits<float>::infinity()
                                                         : 4.0f + 0.1f * static_cast<float>(t % 7));
      const auto of_tile =
          std::ranges::minmax(std::vector(part_limit_.end() - parts_per_tile, part_limit_.end()));
      tile_limit_.push_back(make_float2(of_tile.min, of_tile.max));
    }
  }
  void SetUp() override {
    StageTest::SetUp();
    if (IsSkipped()) return;
    scene_.emplace(staged_.cloud);
    lists_.emplace(*scene_, staged_.camera, staged_.plan, staged_.settings);
    part_ = upload(part_limit_);
    tile_ = upload(tile_limit_);
  }

  [[nodiscard]] Occlusion occlusion() const { return {.part = part_.get(), .tile = tile_.get()}; }
  [[nodiscard]] std::vector<std::uint32_t> visible() const {
    return fetch(lists_->memory().visible.get(), lists_->counts().visible);
  }

  /// Whether the splat reaches a pixel of a part whose limit it is not behind. `slack`: of the
  /// exponent.
  [[nodiscard]] bool shows(const SplatRecord& splat, float depth, double slack) const {
    const math::Whitening<double> w{splat.whitening.xx, splat.whitening.xy, splat.whitening.yy};
    const FrameShape& shape = lists_->shape();
    for (int y = 0; y < shape.height_px; ++y) {
      for (int x = 0; x < shape.width_px; ++x) {
        const auto tile =
            static_cast<std::size_t>(y / tile_side_px * shape.tiles_x + x / tile_side_px);
        const int part =
            y % tile_side_px / part_side_px * parts_across + x % tile_side_px / part_side_px;
        if (depth > part_limit_[tile * parts_per_tile + static_cast<unsigned>(part)]) continue;
        if (splat.log2_opacity - math::whitened_square<double>(w, {x + 0.5 - splat.centre_px.x,
                                                                   y + 0.5 - splat.centre_px.y}) >=
            log2_alpha_min + slack)
          return true;
      }
    }
    return false;
  }

  StagedCase staged_;
  std::optional<StagedScene> scene_;
  std::optional<StagedLists> lists_;
  std::vector<float> part_limit_;   // [tiles][parts_per_tile]
  std::vector<float2> tile_limit_;  // [tiles]
  DeviceBuffer<float> part_;
  DeviceBuffer<float2> tile_;
};

TEST_F(HiddenStage, CullingLeavesOutWhatShowsInNoPixel) {
  lists_->cull();
  lists_->project();
  const std::vector<std::uint32_t> all = visible();
  const auto records = fetch(lists_->memory().records.get(), all.size());
  const auto depths = fetch(lists_->memory().splat_depth.get(), all.size());
  lists_->hide(occlusion());
  lists_->cull();
  const std::vector<std::uint32_t> kept = visible();
  ASSERT_TRUE(std::ranges::includes(all, kept));
  EXPECT_LT(kept.size(), all.size());
  Mismatches lost("cull: hidden Gaussians that show in a pixel", 0.0);
  Mismatches idle("cull: Gaussians kept that show in no pixel", 0.5);
  for (std::size_t v = 0; v < all.size(); ++v) {
    if (!std::ranges::binary_search(kept, all[v])) {
      lost.add(shows(records[v], depths[v], 1e-4));
    } else {
      idle.add(!shows(records[v], depths[v], 0.0));
    }
  }
}

TEST_F(HiddenStage, ListsLackTheBlocksOfPartsThatEndBefore) {
  using Blocks = std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t>;  // by tile, slot
  lists_->cull();
  lists_->project();
  lists_->sort_by_depth();
  const ViewMemory& m = lists_->memory();
  const auto depths = fetch(m.splat_depth.get(), lists_->counts().visible);
  const auto listed = [&] {
    lists_->emit();
    const std::uint32_t count = lists_->counts().list_entries;
    const auto tiles = fetch(reinterpret_cast<const std::uint16_t*>(m.tile.get()), count);
    const auto entries = fetch(m.other_entries.get(), count);
    Blocks blocks;
    for (std::uint32_t k = 0; k < count; ++k)
      if (tiles[k] < lists_->shape().tiles())
        blocks[{tiles[k], entries[k].slot}] = entries[k].blocks;
    return blocks;
  };
  const Blocks all = listed();
  lists_->hide(occlusion());
  const Blocks shown = listed();
  Mismatches blocks("emit: entries without just the blocks behind their limits", 0.0);
  std::size_t cleared = 0;
  for (const auto& [entry, reached] : all) {
    std::uint32_t expected = reached;
    for (int part = 0; part < parts_per_tile; ++part)
      if (depths[entry.second] >
          part_limit_[entry.first * parts_per_tile + static_cast<unsigned>(part)])
        expected &= ~blocks_of(part);
    const auto found = shown.find(entry);
    blocks.add((found == shown.end() ? 0u : found->second) != expected);
    cleared += expected != reached ? 1 : 0;
  }
  for (const auto& [entry, reached] : shown) EXPECT_TRUE(all.contains(entry));
  EXPECT_GT(cleared, 100u);
  EXPECT_LT(shown.size(), all.size());
}

}  // namespace
}  // namespace catgs::cuda::stages
