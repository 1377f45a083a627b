// Which encoder makes a visit's stream, when it opens anew, and what the client is told of it.

#include "server/visit/stream_control.h"

#include "tests/server/visit/fake_host.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

class StreamControlTest : public testing::Test {
 protected:
  StreamControlTest() { hello.viewport_px = {640, 360}; }
  void begin(EncoderKind kind = EncoderKind::x264) {
    stream.begin({scene, {kind, Codec::h264, "first"}}, hello);
    stream.open();
    opened();
  }
  void opened() { stream.on_opened({true, "", Codec::h264, "avc1.42C01F", "libx264"}); }
  /// A frame that was made. True: the client has to be told something first.
  bool make(const FrameOrder& order) {
    FrameResult result;
    result.ok = true;
    result.frame.ticket.size_px = order.encoding.size_px;
    result.frame.ticket.idr = order.force_idr;
    result.codec_string = "avc1.42C01F";
    stream.end_frame();
    return stream.describe(result);
  }
  bool mends(Fault fault, bool still = false) {
    FrameResult failed;
    failed.fault = fault;
    failed.frame.ticket = stream.begin_frame(still, now).ticket;
    stream.end_frame();
    return stream.mend(failed);
  }
  void request(glm::ivec2 size_px, glm::ivec2 still_size_px = {0, 0}) {
    stream.plan().request({.size_px = size_px, .still_size_px = still_size_px}, now += 250ms);
  }

  TimePoint now = TimePoint{} + 1h;
  Hello hello;
  std::shared_ptr<const SceneEntry> scene = test::named_scene("a");
  VisitPolicy policy;
  FlowControl flow;
  test::FakeHost host;
  StreamControl stream{host, policy, flow};
};

TEST_F(StreamControlTest, OpensAsPlannedAndWelcomes) {
  begin();
  ASSERT_EQ(host.opened.size(), 1u);
  EXPECT_EQ(host.opened[0].encoding, stream.plan().moving());
  EXPECT_TRUE(stream.ready());
  const ServerMessage first = stream.introduction();
  ASSERT_TRUE(std::holds_alternative<Welcome>(first));
  EXPECT_EQ(std::get<Welcome>(first).scene.scene_id, "a");
  EXPECT_EQ(std::get<Welcome>(first).config.codec_string, "avc1.42C01F");
  EXPECT_EQ(std::get<Welcome>(first).config.encoder, "first");
  EXPECT_TRUE(std::holds_alternative<StreamConfig>(stream.introduction())) << "it is welcomed once";
}

TEST_F(StreamControlTest, AnotherFormOfItsSceneNeedsNoWelcome) {
  begin();
  EXPECT_TRUE(std::holds_alternative<Welcome>(stream.introduction()));
  stream.begin_frame(false, now);
  const auto tree = test::named_scene("a");
  stream.redraw(tree);
  EXPECT_EQ(host.opened.size(), 1u) << "a frame is under way";
  stream.end_frame();
  ASSERT_EQ(host.opened.size(), 2u);
  opened();
  EXPECT_EQ(stream.scene(), tree.get());
  EXPECT_TRUE(std::holds_alternative<StreamConfig>(stream.introduction()));
  const FrameOrder first = stream.begin_frame(false, now);
  EXPECT_TRUE(first.force_idr);
  EXPECT_TRUE(first.request.waits_for_pages) << "it is no coarser than the picture before";
  stream.end_frame();
  EXPECT_FALSE(stream.begin_frame(false, now).request.waits_for_pages);
}

TEST_F(StreamControlTest, AFormThatCannotBeOpenedLeavesTheOneThatItHas) {
  begin();
  const SceneEntry* const whole = stream.scene();
  const auto tree = test::named_scene("a");
  stream.redraw(tree);
  EXPECT_EQ(stream.scene(), tree.get());
  StreamOpened refused;
  refused.ok = false;
  refused.message = "no memory";
  stream.on_opened(refused);
  EXPECT_TRUE(stream.opening()) << "it goes back";
  EXPECT_EQ(stream.scene(), whole);
  opened();
  EXPECT_TRUE(stream.ready());
  const std::size_t tries = host.opened.size();
  stream.redraw(tree);
  EXPECT_EQ(host.opened.size(), tries) << "it is not tried again";
  EXPECT_EQ(stream.scene(), whole);
}

TEST_F(StreamControlTest, AStreamInUseIsReopenedAfterwards) {
  begin();
  stream.begin_frame(false, now);
  stream.enter_scene(test::named_scene("b"));
  stream.open();
  EXPECT_EQ(host.opened.size(), 1u);
  stream.end_frame();
  EXPECT_EQ(host.opened.size(), 2u);
  EXPECT_TRUE(stream.opening());
  stream.open();
  opened();
  EXPECT_EQ(host.opened.size(), 3u);
  EXPECT_TRUE(stream.opening());
  opened();
  EXPECT_TRUE(stream.ready());
}

TEST_F(StreamControlTest, ANewWishOpensAnEncoderWithAnIdrAndIsTold) {
  begin();
  FrameOrder order = stream.begin_frame(false, now);
  EXPECT_TRUE(order.force_idr);
  request({320, 180});
  EXPECT_FALSE(make(order)) << "that frame was of the old size";
  EXPECT_EQ(stream.config().size_px, glm::ivec2(640, 360));
  order = stream.begin_frame(false, now);
  EXPECT_EQ(order.encoding.size_px, glm::ivec2(320, 180));
  EXPECT_TRUE(order.force_idr);
  EXPECT_TRUE(make(order));
  EXPECT_EQ(stream.config().size_px, glm::ivec2(320, 180));
  order = stream.begin_frame(false, now);
  EXPECT_FALSE(order.force_idr);
  EXPECT_FALSE(make(order));
  EXPECT_EQ(host.opened.size(), 1u) << "its view, with its caches, goes on";
}

TEST_F(StreamControlTest, AnotherEffortOpensTheEncoderAnewWithoutAWord) {
  begin();
  EXPECT_EQ(host.opened[0].encoding.x264_preset, "superfast");
  make(stream.begin_frame(false, now));
  stream.plan().use_effort({.preset = 0, .threads = 4});
  EXPECT_FALSE(stream.idr().wanted()) << "it makes no picture by itself";
  const FrameOrder order = stream.begin_frame(false, now);
  EXPECT_EQ(order.encoding.x264_preset, "ultrafast");
  EXPECT_EQ(order.encoding.threads, 4);
  EXPECT_EQ(order.encoding.size_px, host.opened[0].encoding.size_px);
  EXPECT_TRUE(order.force_idr);
  EXPECT_FALSE(make(order)) << "nothing that the client was told has changed";
}

TEST_F(StreamControlTest, RefinementsStayInTheStreamOfTheirStill) {
  begin();
  request({426, 240}, {1280, 720});
  stream.plan().use_effort({.preset = 0, .threads = 2});
  make(stream.begin_frame(false, now));
  EXPECT_FALSE(stream.shows_still_size());
  const FrameOrder still = stream.begin_frame(true, now);
  make(still);
  EXPECT_TRUE(still.force_idr);
  EXPECT_EQ(still.encoding, stream.plan().still());
  EXPECT_EQ(stream.config().size_px, glm::ivec2(1280, 720));
  EXPECT_EQ(stream.config().fps, policy.default_fps) << "that of moving pictures";
  EXPECT_TRUE(stream.shows_still_size());
  stream.plan().use_effort({.preset = 2, .threads = 1});
  const FrameOrder refinement = stream.begin_frame(true, now);
  make(refinement);
  EXPECT_FALSE(refinement.force_idr);
  EXPECT_EQ(refinement.encoding, still.encoding);
  EXPECT_EQ(stream.begin_frame(false, now).encoding.threads, 1);
}

TEST_F(StreamControlTest, GoesOnWithAnotherEncoderWhereTheDriverOpensNoMore) {
  host.other = EncoderChoice{EncoderKind::x264, Codec::h264, "libx264"};
  stream.begin({scene, {EncoderKind::nvenc, Codec::h264, "h264_nvenc"}}, hello);
  stream.open();
  StreamOpened refused;
  refused.fault = Fault::encoder_unavailable;
  stream.on_opened(refused);
  ASSERT_EQ(host.opened.size(), 2u);
  EXPECT_EQ(host.opened[1].encoder, EncoderKind::x264);
  EXPECT_TRUE(stream.opening());
  stream.on_opened(refused);
  EXPECT_FALSE(stream.opening()) << "nothing is left";
}

TEST_F(StreamControlTest, AStillThatCannotBeSoLargeHasTheSizeOfMotion) {
  begin();
  request({426, 240}, {1280, 720});
  EXPECT_TRUE(mends(Fault::encoder_unavailable, true));
  const FrameOrder order = stream.begin_frame(true, now + 300ms);
  EXPECT_EQ(order.encoding.size_px, glm::ivec2(426, 240));
  EXPECT_TRUE(order.force_idr);
  make(order);
  EXPECT_EQ(stream.begin_frame(true, now).encoding.size_px, glm::ivec2(426, 240))
      << "nor is it tried each time";
}

TEST_F(StreamControlTest, AnEncoderThatFailsAtALargerOneMakesWayAsInMotion) {
  begin(EncoderKind::nvenc);
  request({426, 240}, {1280, 720});
  host.other = EncoderChoice{EncoderKind::x264, Codec::h264, "libx264"};
  EXPECT_TRUE(mends(Fault::encoder_failed, true));
  ASSERT_EQ(host.opened.size(), 2u);
  EXPECT_EQ(host.opened.back().encoder, EncoderKind::x264);
  opened();
  EXPECT_EQ(stream.begin_frame(true, now).encoding.size_px, glm::ivec2(1280, 720))
      << "the other one may manage it";
}

TEST_F(StreamControlTest, ALostDeviceIsNoMatterOfSizesAndEncoders) {
  begin();
  request({426, 240}, {1280, 720});
  host.other = EncoderChoice{EncoderKind::jpeg, Codec::mjpeg, "mjpeg"};
  EXPECT_FALSE(mends(Fault::device_failed, true));
  EXPECT_FALSE(mends(Fault::other));
  EXPECT_EQ(stream.plan().still_size_px(), glm::ivec2(1280, 720));
  EXPECT_EQ(host.opened.size(), 1u);
}

}  // namespace
}  // namespace catgs
