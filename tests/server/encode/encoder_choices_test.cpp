#include "server/encode/encoder_choices.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

const EncoderChoice nvenc{EncoderKind::nvenc, Codec::h264, "h264_nvenc"};
const EncoderChoice x264{EncoderKind::x264, Codec::h264, "libx264"};
const EncoderChoice jpeg{EncoderKind::jpeg, Codec::mjpeg, "mjpeg"};
using Choices = std::vector<EncoderChoice>;
using Codecs = std::vector<Codec>;

TEST(EncoderChoices, AClientGetsTheBestOfTheCodecThatItPrefers) {
  const Choices all = {nvenc, x264, jpeg};
  EXPECT_EQ(best_encoder(all, Codecs{Codec::h264, Codec::mjpeg})->kind, EncoderKind::nvenc);
  EXPECT_EQ(best_encoder(all, Codecs{Codec::mjpeg})->kind, EncoderKind::jpeg);
  EXPECT_EQ(best_encoder(Choices{jpeg}, Codecs{Codec::h264, Codec::mjpeg})->kind,
            EncoderKind::jpeg);
  EXPECT_FALSE(best_encoder(all, {}));
  EXPECT_FALSE(best_encoder(Choices{x264}, Codecs{Codec::mjpeg}));
}

TEST(EncoderChoices, NvencMakesWayForAnotherEncoderOfItsCodecAlone) {
  EXPECT_EQ(instead_of_nvenc(Choices{nvenc, x264, jpeg}, nvenc)->kind, EncoderKind::x264);
  EXPECT_FALSE(instead_of_nvenc(Choices{nvenc, jpeg}, nvenc)) << "a worse codec is no way out";
  EXPECT_FALSE(instead_of_nvenc(Choices{nvenc, x264, jpeg}, x264));
}

}  // namespace
}  // namespace catgs
