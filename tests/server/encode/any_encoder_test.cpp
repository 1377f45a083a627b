// What every encoder owes: colours, refusals, errors that name their cause.

#include "server/encode/decoder.h"
#include "server/encode/encoder.h"
#include "server/encode/test_picture.h"
#include "tests/server/encode/colour.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

class AnyEncoder : public testing::TestWithParam<EncoderKind> {
 protected:
  static EncoderSettings settings_of(glm::ivec2 size_px) {
    EncoderSettings settings;
    settings.size_px = size_px;
    settings.bitrate_kbps = 50000;
    return settings;
  }
};

TEST_P(AnyEncoder, ColoursComeOutAsTheyWentIn) {
  constexpr int patch_px = 32;
  constexpr int patches_x = 8;
  std::vector<glm::ivec3> colours;
  for (const int r : {0, 85, 170, 255}) {
    for (const int g : {0, 85, 170, 255}) {
      for (const int b : {0, 85, 170, 255}) colours.emplace_back(r, g, b);
    }
  }
  const int rows = static_cast<int>(colours.size()) / patches_x;
  I420Picture picture(glm::ivec2(patches_x, rows) * patch_px);
  const auto origin = [&](std::size_t i) {
    return glm::ivec2(static_cast<int>(i) % patches_x, static_cast<int>(i) / patches_x) * patch_px;
  };
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const glm::dvec3 codes = test::video_codes(colours[i]);
    for (int plane = 0; plane < 3; ++plane) {
      const int step = plane == 0 ? 1 : 2;
      const int side = patch_px / step;
      const glm::ivec2 corner = origin(i) / step;
      for (int y = 0; y < side; ++y) {
        const std::size_t row = static_cast<std::size_t>((corner.y + y) * picture.size_px.x / step);
        std::fill_n(picture.planes[plane].begin() + static_cast<std::ptrdiff_t>(row) + corner.x,
                    side, static_cast<std::uint8_t>(codes[plane] + 0.5));
      }
    }
  }

  const auto encoder = make_encoder(GetParam(), settings_of(picture.size_px));
  Decoder decoder(encoder->codec());
  EncodedFrame encoded;
  DecodedPicture decoded;
  for (int frame = 0; frame < 10; ++frame) {  // a few frames refine the still picture
    ASSERT_TRUE(encoder->encode(picture.view(), false, encoded).ok);
    const EncodeStatus status = decoder.decode(encoded.bytes, decoded);
    ASSERT_TRUE(status.ok) << status.message;
  }
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const glm::dvec3 rgb = test::rgb_at(decoded, origin(i) + patch_px / 2);
    for (int channel = 0; channel < 3; ++channel) {
      EXPECT_NEAR(rgb[channel], colours[i][channel], 3)
          << "patch " << colours[i].r << "," << colours[i].g << "," << colours[i].b << " channel "
          << channel;
    }
  }
}

TEST_P(AnyEncoder, TakesStridesAndSizesThatFillNoBlock) {
  for (const glm::ivec2 size : {glm::ivec2(16, 16), glm::ivec2(50, 34), glm::ivec2(642, 18)}) {
    const auto encoder = make_encoder(GetParam(), settings_of(size));
    Decoder decoder(encoder->codec());
    I420Picture plain = moving_picture(size, 0);
    // The same picture in rows that are 24 bytes longer, with other content in between.
    FrameView padded = plain.view();
    std::array<std::vector<std::uint8_t>, 3> storage;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto width = static_cast<std::size_t>(i == 0 ? size.x : size.x / 2);
      for (std::size_t row = 0; row * width < plain.planes[i].size(); ++row) {
        const auto from = plain.planes[i].begin() + static_cast<std::ptrdiff_t>(row * width);
        storage[i].insert(storage[i].end(), from, from + static_cast<std::ptrdiff_t>(width));
        storage[i].insert(storage[i].end(), 24, 255);
      }
      padded.planes[i] = {reinterpret_cast<std::byte*>(storage[i].data()), width + 24};
    }
    EncodedFrame encoded;
    DecodedPicture decoded;
    ASSERT_TRUE(encoder->encode(padded, false, encoded).ok);
    const EncodeStatus status = decoder.decode(encoded.bytes, decoded);
    ASSERT_TRUE(status.ok) << status.message;
    EXPECT_EQ(decoded.size_px, size);
    const auto reference = make_encoder(GetParam(), settings_of(size));
    EncodedFrame plain_encoded;
    ASSERT_TRUE(reference->encode(plain.view(), false, plain_encoded).ok);
    EXPECT_EQ(encoded.bytes, plain_encoded.bytes);
  }
}

TEST_P(AnyEncoder, ReusesTheCallersMemory) {
  const glm::ivec2 size(320, 192);
  const auto encoder = make_encoder(GetParam(), settings_of(size));
  EncodedFrame encoded;
  encoded.bytes.reserve(1 << 20);
  const std::byte* memory = encoded.bytes.data();
  for (int time = 0; time < 3; ++time) {
    I420Picture picture = moving_picture(size, time);
    ASSERT_TRUE(encoder->encode(picture.view(), false, encoded).ok);
    EXPECT_EQ(encoded.bytes.data(), memory);
    EXPECT_GT(encoded.bytes.size(), 0u);
  }
}

TEST_P(AnyEncoder, RefusesImpossibleSettingsByName) {
  const std::vector<std::pair<std::function<void(EncoderSettings&)>, std::string>> cases = {
      {[](auto&) {}, ""},
      {[](auto& s) {
         s.size_px = {321, 192};
       },
       "size 321x192"},
      {[](auto& s) {
         s.size_px = {320, 8194};
       },
       "height 8194"},
      {[](auto& s) {
         s.size_px = {14, 192};
       },
       "width 14"},
      {[](auto& s) { s.fps = 0; }, "frame rate 0"},
      {[](auto& s) { s.bitrate_kbps = 99; }, "bitrate in kbit/s 99"},
      {[](auto& s) { s.threads = 65; }, "threads 65"}};
  for (const auto& [spoil, field] : cases) {
    EncoderSettings settings = settings_of({320, 192});
    spoil(settings);
    EXPECT_EQ(test::refused_field([&] { make_encoder(GetParam(), settings); }), field);
  }
}

TEST_P(AnyEncoder, FrameErrorsNameTheFaultAndPassAway) {
  const glm::ivec2 size(320, 192);
  const auto encoder = make_encoder(GetParam(), settings_of(size));
  EncodedFrame encoded;
  I420Picture picture = moving_picture(size, 0);
  const std::vector<std::pair<std::function<void(FrameView&)>, const char*>> cases = {
      {[](auto& f) {
         f.size_px = {320, 190};
       },
       "320x190"},
      {[](auto& f) { f.format = PixelFormat::rgb_f32; }, "i420"},
      {[](auto& f) { f.space = MemorySpace::device; }, "host memory"},
      {[](auto& f) { f.planes[2].data = nullptr; }, "plane 2"},
      {[](auto& f) { f.planes[1].stride_bytes = 159; }, "plane 1: stride 159"}};
  for (const auto& [spoil, fault] : cases) {
    FrameView frame = picture.view();
    spoil(frame);
    const EncodeStatus status = encoder->encode(frame, false, encoded);
    EXPECT_FALSE(status.ok);
    EXPECT_THAT(status.message, AllOf(StartsWith(std::string(encoder->name())), HasSubstr(fault)));
  }
  ASSERT_TRUE(encoder->encode(picture.view(), false, encoded).ok);
  EXPECT_TRUE(encoded.idr) << "refused frames do not count as the first";
}

INSTANTIATE_TEST_SUITE_P(Kinds, AnyEncoder, testing::Values(EncoderKind::x264, EncoderKind::jpeg),
                         [](const auto& instance) {
                           return std::string(encoder_name(instance.param));
                         });

TEST(MakeEncoder, NeedsAConcreteKind) {
  EncoderSettings settings;
  settings.size_px = {320, 192};
  EXPECT_THROW(make_encoder(EncoderKind::automatic, settings), InputError);
}

TEST(Decoder, SaysWhatIsWrongWithDamagedFrames) {
  EncoderSettings settings;
  settings.size_px = {320, 192};
  const auto encoder = make_encoder(EncoderKind::x264, settings);
  EncodedFrame encoded;
  I420Picture picture = moving_picture(settings.size_px, 0);
  ASSERT_TRUE(encoder->encode(picture.view(), false, encoded).ok);
  encoded.bytes.resize(encoded.bytes.size() / 2);
  Decoder decoder(Codec::h264);
  DecodedPicture decoded;
  const EncodeStatus status = decoder.decode(encoded.bytes, decoded);
  EXPECT_FALSE(status.ok);
  EXPECT_THAT(status.message, HasSubstr("h264: "));
}

}  // namespace
}  // namespace catgs
