#include "render_core/tools/paper/floor_model.h"

#include <gtest/gtest.h>

namespace catgs {
namespace {

/// 1080p and round numbers otherwise.
FrameWork frame() {
  FrameWork frame;
  frame.gaussians = 256e4;
  frame.scene_bytes = 77.0 * frame.gaussians;
  frame.visible = 1e6;
  frame.list_entries = 1e7;
  frame.reached_entries = 4e6;
  frame.warp_evaluations = 13e6;
  frame.tiles = 120.0 * 68.0;
  frame.pixels = 1920.0 * 1080.0;
  return frame;
}

double bytes(Stage stage, FrameKind kind) { return stage_work(stage, kind, frame()).bytes; }

TEST(FloorModel, KeyFramesMoveWhatTheirListsNeed) {
  EXPECT_DOUBLE_EQ(bytes(Stage::project, FrameKind::key), 1e4 * 24 + 1e6 * (77 + 32 + 4 + 4));
  EXPECT_DOUBLE_EQ(bytes(Stage::bin, FrameKind::key), 1e6 * 36 + 1e7 * 6);
  // Three passes over depths; 13 bits of tiles are two.
  EXPECT_DOUBLE_EQ(bytes(Stage::sort, FrameKind::key), 2 * (1e6 * 8 * 3 + 1e7 * 6 * 2));
  EXPECT_DOUBLE_EQ(bytes(Stage::blend, FrameKind::key), 4e6 * 36 + 12.0 * 1920 * 1080);
}

TEST(FloorModel, SubFramesNeedShapesAndWhatTheyReach) {
  EXPECT_DOUBLE_EQ(bytes(Stage::project, FrameKind::sub), 1e6 * (32 + 6 + 32 + 4));
  EXPECT_EQ(bytes(Stage::bin, FrameKind::sub), 0.0);
  EXPECT_DOUBLE_EQ(bytes(Stage::sort, FrameKind::sub), 4e6 * 12);
  EXPECT_EQ(bytes(Stage::blend, FrameKind::sub), bytes(Stage::blend, FrameKind::key));
}

TEST(FloorModel, TheSlowerOfMemoryAndProcessorsCounts) {
  const StageWork blend = stage_work(Stage::blend, FrameKind::sub, frame());
  const DeviceRates rates{
      .dram_bytes_per_s = 1e12, .warp_instructions_per_s = 1e12, .instructions_per_evaluation = 20};
  EXPECT_DOUBLE_EQ(evaluations_ms(blend, rates), 0.26);
  EXPECT_DOUBLE_EQ(bytes_ms(blend, rates), 1e-9 * blend.bytes);
  EXPECT_EQ(floor_ms(blend, rates), evaluations_ms(blend, rates));
  const StageWork sort = stage_work(Stage::sort, FrameKind::key, frame());
  EXPECT_EQ(floor_ms(sort, rates), bytes_ms(sort, rates));
}

}  // namespace
}  // namespace catgs
