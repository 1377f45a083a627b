// How pictures are to be encoded: requests within the policy, and what the server has room for.

#include "server/visit/picture_plan.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

class PicturePlanTest : public testing::Test {
 protected:
  PicturePlanTest() {
    hello.viewport_px = {640, 361};
    plan.begin(hello, {}, 1.0);
  }
  static Settings sized(glm::ivec2 size_px, glm::ivec2 still_size_px = {0, 0}) {
    return {.size_px = size_px, .still_size_px = still_size_px};
  }

  Hello hello;
  TimePoint now = TimePoint{} + 1h;
  VisitPolicy policy;
  FlowControl flow;
  PicturePlan plan{policy, flow};
};

TEST_F(PicturePlanTest, RequestsEndAtThePolicy) {
  const auto request = [&](glm::ivec2 size_px, int kbps) {
    return request_within(policy, {.size_px = size_px, .max_bitrate_kbps = kbps}, {640, 360});
  };
  EXPECT_EQ(request({3840, 2160}, 0).size_px, glm::ivec2(3840, 2160));
  EXPECT_EQ(request({3842, 2160}, 0).size_px, glm::ivec2(3840, 2158));
  EXPECT_EQ(still_size_within(policy, {.still_size_px = {8192, 4608}}, {640, 360}),
            glm::ivec2(3840, 2160));
  EXPECT_EQ(request({}, 99'999).bitrate_kbps, 99'999);
  EXPECT_EQ(request({}, 100'001).bitrate_kbps, 100'000);
}

TEST_F(PicturePlanTest, AStillIsNoSmallerThanMotionAndWithinTheLimit) {
  policy.max_pixels = 640 * 360;
  Settings settings;
  settings.size_px = {426, 240};
  settings.still_size_px = {3840, 2160};
  EXPECT_EQ(still_size_within(policy, settings, {100, 100}), glm::ivec2(640, 360));
  settings.still_size_px = {64, 36};
  EXPECT_EQ(still_size_within(policy, settings, {100, 100}), glm::ivec2(426, 240));
  settings.still_size_px = {640, 360};
  settings.fixed_quality = true;
  EXPECT_EQ(still_size_within(policy, settings, {100, 100}), glm::ivec2(426, 240));
}

TEST_F(PicturePlanTest, IsThatOfTheHelloUntilTheClientAsksForAnother) {
  EXPECT_EQ(plan.moving().size_px, glm::ivec2(640, 360)) << "made even";
  EXPECT_EQ(plan.moving().fps, policy.default_fps);
  EXPECT_EQ(plan.moving().bitrate_kbps, policy.default_bitrate_kbps);
  EXPECT_EQ(plan.still(), plan.moving());
  Settings settings = sized({320, 180});
  settings.max_fps = 30;
  plan.request(settings, now);
  EXPECT_EQ(plan.moving().size_px, glm::ivec2(320, 180));
  EXPECT_EQ(plan.moving().fps, 30);
}

TEST_F(PicturePlanTest, HalvesOfTwoEyesHaveEvenSides) {
  Settings settings = sized({2 * 333, 361}, {2 * 667, 700});
  settings.stereo = Stereo{};
  plan.request(settings, now);
  EXPECT_EQ(plan.stereo(), settings.stereo);
  EXPECT_EQ(plan.moving().size_px, glm::ivec2(664, 360));
  EXPECT_EQ(plan.still_size_px(), glm::ivec2(1332, 700));
  for (const double share : {0.9, 0.7, 0.5, 0.3, 0.2}) {
    plan.use_pixel_share(share);
    EXPECT_EQ(plan.moving().size_px.x % 4, 0) << share;
  }
  plan.use_pixel_share(1.0);
  settings.stereo.reset();
  plan.request(settings, now += 1s);
  EXPECT_FALSE(plan.stereo());
  EXPECT_EQ(plan.moving().size_px, glm::ivec2(666, 360));
}

TEST_F(PicturePlanTest, EyesComeWithTheirSizes) {
  Settings settings = sized({640, 320});
  plan.request(settings, now);
  settings.size_px = {1280, 640};
  settings.stereo = Stereo{};
  plan.request(settings, now + 1ms);
  EXPECT_FALSE(plan.stereo()) << "settings that alternate wait";
  EXPECT_EQ(plan.moving().size_px, glm::ivec2(640, 320));
  plan.on_tick(now + 1s);
  EXPECT_TRUE(plan.stereo());
  EXPECT_EQ(plan.moving().size_px, glm::ivec2(1280, 640));
}

// Each combination would be another encoder, and an IDR.
TEST_F(PicturePlanTest, SettingsThatAlternateQuicklyAreFollowedFourTimesASecond) {
  int encoders = 0;
  EncoderSettings last = plan.moving();
  Settings settings;
  for (int ms = 1; ms <= 1000; ++ms) {
    now += 1ms;
    settings = sized({320 + 2 * (ms % 100), 180});
    plan.request(settings, now);
    if (ms % 250 == 0) plan.on_tick(now);
    if (std::exchange(last, plan.moving()) != plan.moving()) ++encoders;
  }
  EXPECT_LE(encoders, 5);
  EXPECT_GE(encoders, 3);
  now += 250ms;
  plan.on_tick(now);
  EXPECT_EQ(plan.moving().size_px, settings.size_px) << "the last request is not forgotten";
}

TEST_F(PicturePlanTest, AShareOfThePixelsConcernsMotionAlone) {
  plan.request(sized({640, 360}, {1280, 720}), now);
  plan.use_pixel_share(0.25);
  EXPECT_EQ(plan.moving().size_px, glm::ivec2(320, 180));
  EXPECT_EQ(plan.still_size_px(), glm::ivec2(1280, 720));
}

TEST_F(PicturePlanTest, StillsThatFailedAreAsInMotionUntilTheClientWishesAnew) {
  plan.request(sized({426, 240}, {1280, 720}), now);
  EXPECT_EQ(plan.still().size_px, glm::ivec2(1280, 720));
  EXPECT_EQ(plan.still().fps, still_fps);
  plan.allow_larger_stills(false);
  EXPECT_EQ(plan.still(), plan.moving());
  plan.request(sized({426, 240}, {1920, 1080}), now += 250ms);
  EXPECT_EQ(plan.still().size_px, glm::ivec2(1920, 1080));
}

TEST_F(PicturePlanTest, KeepsItsSizeWithoutALadder) {
  for (const bool ladder : {true, false}) {
    policy.quality_ladder = ladder;
    FlowControl slow;
    PicturePlan own{policy, slow};
    own.begin(hello, {}, 1.0);
    Settings settings;
    settings.max_bitrate_kbps = 100;  // 0.007 bits a pixel
    own.request(settings, now);
    for (int i = 0; i < 20; ++i) own.on_tick(now += 250ms);
    EXPECT_EQ(own.moving().size_px.x < 640, ladder);
  }
}

TEST_F(PicturePlanTest, AdaptiveQuantisationIsThePolicys) {
  policy.x264_aq = 1.5;
  plan.begin(hello, {}, 1.0);
  EXPECT_EQ(plan.moving().aq_strength, 1.5);
  EXPECT_EQ(plan.still().aq_strength, 1.5);
}

TEST_F(PicturePlanTest, StillsOfTheirOwnSizeAreMadeWithGoodEffortInOneSlice) {
  plan.use_effort({.preset = 0, .threads = 4});
  EXPECT_EQ(plan.moving().x264_preset, "ultrafast");
  EXPECT_EQ(plan.moving().threads, 4);
  EXPECT_EQ(plan.still(), plan.moving()) << "in the stream of motion";
  plan.request(sized({426, 240}, {1280, 720}), now);
  EXPECT_EQ(plan.still().x264_preset, "superfast") << "less effort would cost more bytes";
  EXPECT_EQ(plan.still().threads, 1);
}

}  // namespace
}  // namespace catgs
