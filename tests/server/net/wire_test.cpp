#include "server/net/wire.h"

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "tests/server/net/wire_messages.h"
#include "tests/support/captured_log.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

std::vector<std::byte> unhex(const std::string& text) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoi(text.substr(i, 2), nullptr, 16)));
  return bytes;
}

/// Bytes that both sides of the wire agree on, made by neither.
std::string golden(const std::string& name) {
  std::ifstream in(CATGS_WIRE_GOLDEN);
  return nlohmann::json::parse(in).at(name).get<std::string>();
}

v1::ClientMessage good_hello() {
  v1::ClientMessage message;
  auto& hello = *message.mutable_hello();
  hello.set_version(1);
  hello.set_viewport_width_px(640);
  hello.set_viewport_height_px(360);
  return message;
}

v1::ClientMessage good_pose() {
  v1::ClientMessage message;
  message.mutable_pose()->mutable_world_from_camera()->mutable_orientation()->set_w(1.0f);
  message.mutable_pose()->set_fov_y_rad(1.0f);
  return message;
}

TEST(Wire, APoseMaySayThatNothingMoves) {
  v1::ClientMessage message = good_pose();
  EXPECT_FALSE(parsed<PoseSample>(message).at_rest);
  message.mutable_pose()->set_at_rest(true);
  EXPECT_TRUE(parsed<PoseSample>(message).at_rest);
}

TEST(Wire, ParsesGoldenClientMessages) {
  const auto hello = parsed<Hello>(unhex(golden("client_hello")));
  EXPECT_EQ(hello.version, 1u);
  EXPECT_EQ(hello.scene_id, "city");
  EXPECT_EQ(hello.viewport_px, glm::ivec2(640, 360));
  EXPECT_THAT(hello.decoders, ElementsAre(Codec::h264, Codec::mjpeg));
  EXPECT_EQ(hello.token, "secret");
  EXPECT_EQ(hello.settings.max_fps, 30);

  const auto pose = parsed<PoseSample>(unhex(golden("client_pose")));
  EXPECT_EQ(pose.pose_id, 300u);
  EXPECT_EQ(pose.client_time_us, 1234567890123);
  EXPECT_EQ(pose.world_from_camera.position, glm::vec3(1.0f, -2.5f, 0.125f));
  EXPECT_FLOAT_EQ(pose.world_from_camera.orientation.y, 0.6f);
  EXPECT_FLOAT_EQ(pose.world_from_camera.orientation.w, 0.8f);

  const auto ack = parsed<Ack>(unhex(golden("client_ack")));
  EXPECT_EQ(ack.frame_id, 7u);
  EXPECT_EQ(ack.presented_us, 3000);
  EXPECT_EQ(ack.pose_age_us, 2500u);
  EXPECT_FALSE(ack.dropped);
}

TEST(Wire, WritesGoldenServerMessages) {
  EXPECT_EQ(
      hex(wire::serialize(ErrorMessage{ErrorCode::server_full, "8 of 8 sessions are in use", true})
              .bytes),
      golden("server_error"));
  EXPECT_EQ(hex(wire::serialize(
                    StreamConfig{Codec::h264, "avc1.42C01F", {1280, 720}, 60, 8000, "libx264"})
                    .bytes),
            golden("server_config"));
}

TEST(Wire, WritesTheGoldenFrame) {
  FrameTicket ticket;
  ticket.frame_id = 9;
  ticket.pose_id = 300;
  ticket.pose_client_time_us = 1234567890123;
  ticket.render_pose.position.x = 1.0f;
  ticket.fov_y_rad = 1.0f;
  ticket.idr = true;
  ticket.size_px = {640, 360};
  ticket.pose_received = TimePoint{} + 1s;
  const TimePoint rendered = ticket.pose_received + 400us + 20ms;
  ticket.render = {rendered - 20ms, rendered};
  ticket.encode = {rendered, rendered + 3ms};
  std::vector<std::byte> packet;
  wire::append_frame_header(ticket, nullptr, rendered + 3ms + 50us, packet);
  EXPECT_EQ(hex(packet) + "000000016742c01f", golden("server_frame"));
}

TEST(Wire, FramesBringTheirDepthsWhereTheyHaveSome) {
  FrameTicket ticket;
  ticket.render = ticket.encode = StageTime{};
  const auto header = [&](const PackedDepths* depths) {
    std::vector<std::byte> packet;
    wire::append_frame_header(ticket, depths, {}, packet);
    v1::FrameHeader out;
    EXPECT_TRUE(out.ParseFromArray(packet.data() + 2, static_cast<int>(packet.size()) - 2));
    return out;
  };
  EXPECT_EQ(header(nullptr).depth_columns(), 0u);
  const PackedDepths packed{{3, 2}, 0.5f, {std::byte{1}, std::byte{2}}};
  const v1::FrameHeader with = header(&packed);
  EXPECT_EQ(with.depth_columns(), 3u);
  EXPECT_EQ(with.depth_rows(), 2u);
  EXPECT_EQ(with.depth_scale(), 0.5f);
  EXPECT_EQ(with.depth_codes(), "\x01\x02");
}

TEST(Wire, ClientsThatDoNotAskForDepthsGetNone) {
  v1::ClientMessage message;
  message.mutable_settings();
  EXPECT_FALSE(parsed<Settings>(message).depths);
  message.mutable_settings()->set_depths(true);
  EXPECT_TRUE(parsed<Settings>(message).depths);
}

TEST(Wire, EveryServerMessageReadsBack) {
  const auto reread = [](const ServerMessage& message) {
    const auto bytes = wire::serialize(message).bytes;
    EXPECT_EQ(bytes.at(0), std::byte{1});
    v1::ServerMessage out;
    EXPECT_TRUE(out.ParseFromArray(bytes.data() + 1, static_cast<int>(bytes.size()) - 1));
    return out;
  };
  Welcome welcome;
  welcome.session_id = "abc";
  welcome.scene.scene_id = "city";
  welcome.scene.focus = {1.0f, 2.0f, 3.0f};
  welcome.scene.model = SplatModel::antialiased;
  welcome.scene.about = {"The city", "Ada", "MIT", CameraMode::walk, 0x0a10ff, 0.25f};
  welcome.scene.up_is_doubtful = true;
  welcome.scene.origin = {500123.0, 5412345.0, 431.0};
  welcome.scene_ids = {"city", "garden"};
  const auto greeting = reread(welcome).welcome();
  EXPECT_EQ(greeting.version(), 1u);
  EXPECT_EQ(greeting.scene().focus().z(), 3.0f);
  EXPECT_EQ(greeting.scene().start_pose().orientation().w(), 1.0f);
  EXPECT_EQ(greeting.scene().credits(), "Ada");
  EXPECT_EQ(greeting.scene().licence(), "MIT");
  EXPECT_EQ(greeting.scene().mode(), v1::CAMERA_MODE_WALK);
  EXPECT_EQ(greeting.scene().model(), "antialiased");
  EXPECT_EQ(greeting.scene().background_rgb(), 0x0a10ffu);
  EXPECT_EQ(greeting.scene().metres_per_unit(), 0.25f);
  EXPECT_EQ(greeting.scene().origin().y(), 5412345.0);
  EXPECT_TRUE(greeting.scene().up_is_doubtful());
  EXPECT_FALSE(reread(Welcome()).welcome().scene().has_origin());
  EXPECT_EQ(greeting.scene_ids(1), "garden");
  EXPECT_EQ(reread(Stats{.fps = 12.5f, .sessions = 4}).stats().sessions(), 4u);
  EXPECT_EQ(reread(Heartbeat{77}).heartbeat().server_time_us(), 77);
  EXPECT_EQ(reread(Drain{1000}).drain().deadline_ms(), 1000u);
}

TEST(Wire, NamesTheFieldThatIsWrong) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float infinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(wrong_field(good_hello()), "");
  EXPECT_EQ(wrong_field(good_pose()), "");

  auto hello = good_hello();
  hello.mutable_hello()->mutable_settings()->set_width_px(640);
  EXPECT_EQ(wrong_field(hello), "settings.width_px");
  hello = good_hello();
  hello.mutable_hello()->mutable_settings()->set_still_height_px(640);
  EXPECT_EQ(wrong_field(hello), "settings.still_width_px");
  hello.mutable_hello()->mutable_settings()->set_still_width_px(9000);
  EXPECT_EQ(wrong_field(hello), "settings.still_width_px");

  for (const float bad : {nan, infinity, -infinity, 1.0e30f}) {
    auto pose = good_pose();
    pose.mutable_pose()->mutable_world_from_camera()->mutable_position()->set_y(bad);
    EXPECT_EQ(wrong_field(pose), "pose.position.y") << bad;
  }
  for (const float w : {0.0f, 0.5f, 1.2f, nan}) {
    auto pose = good_pose();
    pose.mutable_pose()->mutable_world_from_camera()->mutable_orientation()->set_w(w);
    EXPECT_EQ(wrong_field(pose), "pose.orientation") << w;
  }
}

TEST(Wire, TakesWhatIsWithinTheLimitsAndNothingBeyond) {
  const auto expect_limit = [](const char* field, v1::ClientMessage message, auto set, auto taken,
                               auto refused) {
    set(message, taken);
    EXPECT_EQ(wrong_field(message), "") << taken;
    set(message, refused);
    EXPECT_EQ(wrong_field(message), field) << refused;
  };
  const auto pose = [&](const char* field, auto set, auto taken, auto refused) {
    expect_limit(
        field, good_pose(), [&](auto& m, auto v) { set(*m.mutable_pose(), v); }, taken, refused);
  };
  const auto x = [](auto& p, float v) {
    p.mutable_world_from_camera()->mutable_position()->set_x(v);
  };
  pose("pose.position.x", x, 1e9f, 1.00001e9f);
  pose("pose.position.x", x, -1e9f, -1.00001e9f);
  const auto time = [](auto& p, std::int64_t v) { p.set_client_time_us(v); };
  pose("pose.client_time_us", time, 9'007'199'254'740'992, 9'007'199'254'740'993);
  pose("pose.client_time_us", time, -9'007'199'254'740'992, -9'007'199'254'740'993);
  const auto fov = [](auto& p, float v) { p.set_fov_y_rad(v); };
  pose("pose.fov_y_rad", fov, 0.1f, 0.0999f);
  pose("pose.fov_y_rad", fov, 2.8f, 2.8001f);
  pose("pose.fov_y_rad", fov, 1.0f, std::numeric_limits<float>::quiet_NaN());

  const auto hello = [&](const char* field, auto set, auto taken, auto refused) {
    expect_limit(
        field, good_hello(), [&](auto& m, auto v) { set(*m.mutable_hello(), v); }, taken, refused);
  };
  const auto width = [](auto& h, std::uint32_t v) { h.set_viewport_width_px(v); };
  hello("hello.viewport_width_px", width, 16, 15);
  hello("hello.viewport_width_px", width, 8192, 8193);
  const auto height = [](auto& h, std::uint32_t v) { h.set_viewport_height_px(v); };
  hello("hello.viewport_height_px", height, 16, 15);
  hello("hello.viewport_height_px", height, 8192, 8193);
  const auto decoders = [](auto& h, int count) {
    h.clear_decoders();
    for (int i = 0; i < count; ++i) h.add_decoders(v1::CODEC_H264);
  };
  hello("hello.decoders", decoders, 8, 9);
  const auto of = [](int length) { return std::string(static_cast<std::size_t>(length), 'x'); };
  hello(
      "hello.scene_id", [&](auto& h, int n) { h.set_scene_id(of(n)); }, 128, 129);
  hello(
      "hello.token", [&](auto& h, int n) { h.set_token(of(n)); }, 512, 513);
  hello(
      "hello.watch", [&](auto& h, int n) { h.set_watch(of(n)); }, 512, 513);
  const auto resume = [&](auto& h, int n) { h.mutable_resume()->set_token(of(n)); };
  hello("hello.resume.token", resume, 512, 513);

  const auto settings = [&](const char* field, auto set, auto taken, auto refused) {
    expect_limit(
        field, {}, [&](auto& m, auto v) { set(*m.mutable_settings(), v); }, taken, refused);
  };
  const auto sides = [](auto& s, std::uint32_t v) {
    s.set_width_px(v);
    s.set_height_px(v);
  };
  settings("settings.width_px", sides, 16, 15);
  settings("settings.width_px", sides, 8192, 8193);
  const auto fps = [](auto& s, std::uint32_t v) { s.set_max_fps(v); };
  settings("settings.max_fps", fps, 1, 241);
  settings("settings.max_fps", fps, 240, 241);
  const auto rate = [](auto& s, std::uint32_t v) { s.set_max_bitrate_kbps(v); };
  settings("settings.max_bitrate_kbps", rate, 100, 99);
  settings("settings.max_bitrate_kbps", rate, 200'000, 200'001);
}

TEST(Wire, TakesMessagesOf64KiB) {
  // A field of a later version: its number, the length of its text, the text.
  const auto parsed_of = [](std::size_t bytes) {
    std::string message = "\xa2\x06\xfb\xff\x03";
    message.resize(bytes, 'x');
    return wire::parse_client_message(std::as_bytes(std::span(message)));
  };
  EXPECT_TRUE(std::holds_alternative<ClientMessage>(parsed_of(65'536)));
  const auto refused = parsed_of(65'537);
  EXPECT_EQ(std::get<wire::ParseError>(refused).what, "message: 65537 bytes, at most 65536");
}

TEST(Wire, ProtobufLogsAboutStrangersAtDebugLevelOnly) {
  const test::CapturedLog log;
  // hello { token: "\xff" } as bytes: protobuf's own writer refuses it.
  v1::ClientMessage message;
  message.mutable_hello()->set_token("t");
  std::string text = message.SerializeAsString();
  text.back() = '\xff';
  const auto parse = [&] { return wire::parse_client_message(std::as_bytes(std::span(text))); };
  parse();
  EXPECT_EQ(log.text(), "");
  spdlog::default_logger()->set_level(spdlog::level::debug);
  EXPECT_TRUE(std::holds_alternative<wire::ParseError>(parse()));
  EXPECT_THAT(log.text(), AllOf(HasSubstr("protobuf: "), HasSubstr("UTF-8")));
}

TEST(Wire, NoPictureIsTakenForOlderThanTenSeconds) {
  for (const std::uint32_t age_us : {0u, 10'000'000u, 10'000'001u, 4'294'967'295u}) {
    v1::ClientMessage message;
    message.mutable_ack()->set_frame_id(1);
    message.mutable_ack()->set_pose_age_us(age_us);
    EXPECT_EQ(parsed<Ack>(message).pose_age_us, std::min(age_us, 10'000'000u));
  }
}

TEST(Wire, NormalisesQuaternions) {
  auto message = good_pose();
  message.mutable_pose()->mutable_world_from_camera()->mutable_orientation()->set_w(1.05f);
  EXPECT_FLOAT_EQ(glm::length(parsed<PoseSample>(message).world_from_camera.orientation), 1.0f);
}

TEST(Wire, PathsAreInTimeOrderAndBounded) {
  v1::ClientMessage message;
  for (int i = 0; i < 3; ++i) {
    auto& sample = *message.mutable_path()->add_samples();
    sample = good_pose().pose();
    sample.set_client_time_us(i == 2 ? 0 : i + 1);
  }
  EXPECT_EQ(wrong_field(message), "path.samples") << "not in time order";
  message.mutable_path()->clear_samples();
  for (int i = 0; i < 256; ++i) *message.mutable_path()->add_samples() = good_pose().pose();
  EXPECT_EQ(wrong_field(message), "");
  *message.mutable_path()->add_samples() = good_pose().pose();
  EXPECT_EQ(wrong_field(message), "path.samples");
}

TEST(Wire, AResumingHelloCarriesWhatIsLeftOfATour) {
  v1::ClientMessage message = good_hello();
  for (int i = 0; i < 2; ++i) {
    auto& sample = *message.mutable_hello()->mutable_resume()->mutable_path()->add_samples();
    sample = good_pose().pose();
    sample.set_client_time_us(i + 1);
  }
  EXPECT_EQ(parsed<Hello>(message).resume_path.samples.size(), 2u);
  message.mutable_hello()->mutable_resume()->mutable_path()->mutable_samples(1)->set_fov_y_rad(9);
  EXPECT_EQ(wrong_field(message), "pose.fov_y_rad");
}

TEST(Wire, IgnoresWhatIsNewAndRefusesWhatIsBroken) {
  EXPECT_NO_THROW(parsed<UnknownMessage>(v1::ClientMessage()));
  EXPECT_NO_THROW(parsed<UnknownMessage>(unhex("a20600")));  // field 100 of a later version
  for (const char* broken : {"ff", "0a05", "1a02ffff"}) {
    const auto result = wire::parse_client_message(unhex(broken));
    EXPECT_TRUE(std::holds_alternative<wire::ParseError>(result)) << broken;
  }
  const std::vector<std::byte> huge(wire::max_client_message_bytes + 1);
  EXPECT_TRUE(std::holds_alternative<wire::ParseError>(wire::parse_client_message(huge)));
}

v1::ClientMessage good_pick() {
  v1::ClientMessage message;
  message.mutable_pick()->set_id(7);
  message.mutable_pick()->mutable_origin()->set_x(1.0f);
  message.mutable_pick()->mutable_direction()->set_z(-4.0f);
  return message;
}

TEST(Wire, RefusesTextThatIsNotUtf8AndPrintsNothing) {
  v1::ClientMessage message;
  message.mutable_select_scene()->set_scene_id("\xff");
  const std::string bytes = message.SerializeAsString();
  testing::internal::CaptureStderr();
  const auto parsed = wire::parse_client_message(std::as_bytes(std::span(bytes)));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_TRUE(std::holds_alternative<wire::ParseError>(parsed));
}

TEST(Wire, ReadsAndChecksPicks) {
  const auto pick = parsed<Pick>(good_pick());
  EXPECT_EQ(pick.id, 7u);
  EXPECT_EQ(pick.origin.x, 1.0f);
  EXPECT_EQ(pick.direction.z, -1.0f);
  auto message = good_pick();
  message.mutable_pick()->mutable_direction()->set_z(0.0f);
  EXPECT_EQ(wrong_field(message), "pick.direction");
  message = good_pick();
  message.mutable_pick()->mutable_origin()->set_y(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(wrong_field(message), "pick.origin.y");
}

TEST(Wire, SaysWhichMessagesReplaceEachOther) {
  EXPECT_EQ(wire::serialize(Welcome{}).topic, Topic::session);
  EXPECT_EQ(wire::serialize(StreamConfig{}).topic, Topic::stream);
  EXPECT_EQ(wire::serialize(QueuePosition{}).topic, Topic::place);
  EXPECT_EQ(wire::serialize(Stats{}).topic, Topic::statistics);
  EXPECT_EQ(wire::serialize(Heartbeat{}).topic, Topic::clock);
  EXPECT_EQ(wire::serialize(ErrorMessage{}).topic, Topic::event);
  EXPECT_EQ(wire::serialize(Drain{}).topic, Topic::event);
  EXPECT_EQ(wire::serialize(Picked{}).topic, Topic::event);
  EXPECT_EQ(wire::serialize(Lead{}).topic, Topic::leader);
}

TEST(Wire, StopsAreThoseThatToursMayHave) {
  v1::ClientMessage message;
  message.mutable_reached()->set_tour(31);
  EXPECT_EQ(wrong_field(message), "");
  message.mutable_reached()->set_stop(256);
  EXPECT_EQ(wrong_field(message), "reached.stop");
}

TEST(Wire, BoundsTheNameOfALeaderAndTheTokenOfAFollower) {
  v1::ClientMessage message;
  message.mutable_present()->set_name(std::string(65, 'a'));
  EXPECT_EQ(wrong_field(message), "present.name");
  message.mutable_present()->set_name("a\n");
  EXPECT_EQ(wrong_field(message), "present.name");
  message.mutable_follow()->set_watch(std::string(513, 'a'));
  EXPECT_EQ(wrong_field(message), "follow.watch");
}

TEST(Wire, AnswersPicks) {
  EXPECT_EQ(hex(wire::serialize(Picked{7, 2.0f}).bytes),
            "01"
            "42090807"
            "1001"
            "1d00000040");
  EXPECT_EQ(hex(wire::serialize(Picked{7, std::nullopt}).bytes), "0142020807");
}

}  // namespace
}  // namespace catgs
