#include "server/encode/h264_level.h"

#include <ostream>

#include "tests/support/test.h"

namespace catgs::h264 {
namespace {

struct Case {
  glm::ivec2 size_px;
  int fps;
  int bitrate_kbps;
  int level_idc;
};
void PrintTo(const Case& c, std::ostream* out) {
  *out << c.size_px.x << "x" << c.size_px.y << " at " << c.fps << " fps, " << c.bitrate_kbps
       << " kbit/s";
}

class Level : public testing::TestWithParam<Case> {};

TEST_P(Level, IsTheLowestThatAdmits) {
  const Case& c = GetParam();
  EXPECT_EQ(level(c.size_px, c.fps, c.bitrate_kbps), c.level_idc);
}

// The maximum rates that ITU-T H.264 table A-6 lists for common sizes, and the steps beside them.
INSTANTIATE_TEST_SUITE_P(
    TableA1, Level,
    testing::Values(Case{{176, 144}, 15, 64, 10}, Case{{176, 144}, 16, 64, 11},
                    Case{{352, 288}, 15, 384, 12}, Case{{352, 288}, 30, 768, 13},
                    Case{{352, 288}, 30, 769, 20}, Case{{640, 360}, 30, 2000, 30},
                    Case{{640, 360}, 60, 8000, 31}, Case{{720, 576}, 25, 10000, 30},
                    Case{{1280, 720}, 30, 14000, 31}, Case{{1280, 720}, 31, 14000, 32},
                    Case{{1280, 720}, 60, 20000, 32}, Case{{1280, 720}, 60, 20001, 41},
                    Case{{1920, 1080}, 30, 20000, 40}, Case{{1920, 1080}, 30, 50000, 41},
                    Case{{1920, 1080}, 60, 50000, 42}, Case{{1920, 1080}, 60, 60000, 50},
                    Case{{1920, 1080}, 120, 50000, 51}, Case{{2560, 1440}, 30, 20000, 50},
                    Case{{3840, 2160}, 30, 20000, 51}, Case{{3840, 2160}, 60, 20000, 52},
                    Case{{4096, 2304}, 56, 20000, 52}, Case{{3840, 2160}, 120, 20000, 60},
                    Case{{8192, 4320}, 30, 100000, 60}, Case{{8192, 4320}, 120, 200000, 62},
                    // A.3.1 bounds each side as well: to 256 macroblocks at level 4.
                    Case{{4096, 16}, 10, 64, 40}, Case{{16, 4112}, 10, 64, 42}));

TEST(Level, NoneForWhatNoDecoderTakes) {
  EXPECT_EQ(level({8192, 8192}, 30, 8000), std::nullopt);
  EXPECT_EQ(level({8192, 4320}, 240, 8000), std::nullopt);
  EXPECT_EQ(level({1920, 1080}, 60, 800001), std::nullopt);
}

TEST(LevelMaxBitrate, IsThatOfTheTable) {
  EXPECT_EQ(level_max_bitrate_kbps(31), 14000);
  EXPECT_EQ(level_max_bitrate_kbps(52), 240000);
  EXPECT_EQ(level_max_bitrate_kbps(33), std::nullopt);
}

}  // namespace
}  // namespace catgs::h264
