#include "server/encode/selftest.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

using testing::ContainsRegex;

TEST(Selftest, PassesAndNamesEveryEncoder) {
  std::ostringstream out;
  EXPECT_EQ(run_selftest(out), 0) << out.str();
  EXPECT_THAT(out.str(), Not(HasSubstr("FAILED")));
  EXPECT_THAT(out.str(), HasSubstr("h264_nvenc"));
  EXPECT_THAT(out.str(), ContainsRegex("libx264 +640x360 .* avc1\\.64001F"));
  EXPECT_THAT(out.str(), ContainsRegex("libx264 +1920x1080 .* avc1\\.64002A"));
  EXPECT_THAT(out.str(), ContainsRegex("mjpeg +1280x720 .* JFIF"));
}

}  // namespace
}  // namespace catgs
