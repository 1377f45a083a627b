#include "server/encode/encoder.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

TEST(ProbeEncoders, TriesAllBestFirstAndGivesReasons) {
  const std::vector<EncoderProbe> probes = probe_encoders();
  ASSERT_EQ(probes.size(), 3u);
  EXPECT_EQ(probes[0].kind, EncoderKind::nvenc);
  EXPECT_EQ(probes[1].kind, EncoderKind::x264);
  EXPECT_EQ(probes[2].kind, EncoderKind::jpeg);
  for (const EncoderProbe& probe : probes) {
    EXPECT_EQ(probe.name, encoder_name(probe.kind));
    EXPECT_FALSE(probe.reason.empty());
    EncoderSettings settings;
    settings.size_px = {320, 192};
    if (probe.usable) {
      EXPECT_NO_THROW(make_encoder(probe.kind, settings)) << probe.name;
    } else {
      EXPECT_ANY_THROW(make_encoder(probe.kind, settings)) << probe.name;
    }
  }
  EXPECT_TRUE(probes[1].usable) << probes[1].reason;
  EXPECT_TRUE(probes[2].usable) << probes[2].reason;
}

// libav's own words belong in our messages, not on the terminal.
TEST(ProbeEncoders, PrintsNothing) {
  testing::internal::CaptureStderr();
  const auto probes = probe_encoders();
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_FALSE(probes.empty());
}

}  // namespace
}  // namespace catgs
