// The registry with devices and encoders that are not there: who gets which.

#include <atomic>
#include <deque>

#include <gtest/gtest.h>

#include "proto/catgs.pb.h"
#include "server/schedule/pool_executor.h"
#include "server/session/session_registry.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

/// A socket that is always read. Session thread only, but for queued frames.
class OpenConnection final : public Connection {
 public:
  void send(std::vector<std::byte> message) override {
    v1::ServerMessage parsed;
    if (!parsed.ParseFromArray(message.data() + 1, static_cast<int>(message.size()) - 1))
      throw std::logic_error("no ServerMessage");
    if (parsed.has_welcome()) welcome = parsed.welcome();
    waits = parsed.has_queue();
  }
  std::vector<std::uint64_t> send(OutgoingFrame frame) override {
    frames.push_back(frame.ticket.frame_id);
    return {};
  }
  void close(CloseCode, std::string_view) override {}
  [[nodiscard]] std::string peer_address() const override { return "192.0.2.1"; }
  [[nodiscard]] std::size_t queued_frames() const override { return 0; }

  std::optional<v1::Welcome> welcome;
  bool waits = false;
  std::vector<std::uint64_t> frames;
};

/// Devices on which a frame takes as long as somebody says.
class PretendedRenderer final : public Renderer {
 public:
  explicit PretendedRenderer(std::shared_ptr<DeviceSet> devices) : devices_(std::move(devices)) {}
  [[nodiscard]] std::string description() const override { return "pretended"; }
  [[nodiscard]] std::size_t scene_bytes() const override { return 0; }
  [[nodiscard]] std::unique_ptr<View> make_view(const ViewSettings&) override {
    return std::make_unique<PretendedView>(*this, devices_->take(device_ids_));
  }
  std::array<std::atomic<float>, 2> frame_ms{};

 private:
  class PretendedView final : public View {
   public:
    PretendedView(const PretendedRenderer& renderer, DeviceSet::Place place)
        : renderer_(renderer), place_(std::move(place)) {}
    RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override {
      frame.size_px = request.camera.size_px;
      frame.stats.stage_ms[0] = renderer_.frame_ms[static_cast<std::size_t>(place_.device())];
      return {};
    }
    [[nodiscard]] std::size_t memory_bytes() const override { return 0; }
    [[nodiscard]] std::optional<int> device() const override { return place_.device(); }

   private:
    const PretendedRenderer& renderer_;
    DeviceSet::Place place_;
  };

  const std::shared_ptr<DeviceSet> devices_;
  const std::vector<int> device_ids_ = {0, 1};
};

/// One scene, always in memory.
class OneScene final : public SceneSource {
 public:
  explicit OneScene(std::shared_ptr<Renderer> renderer) {
    scene_->renderer = std::move(renderer);
    scene_->facts.near_z = 0.2f;
  }
  [[nodiscard]] std::string default_scene() const override { return "scene"; }
  [[nodiscard]] std::vector<std::string> scene_ids() const override { return {"scene"}; }
  [[nodiscard]] bool has(const std::string&) const override { return true; }
  SceneAnswer want(const std::string&, TimePoint) override {
    return std::shared_ptr<const SceneEntry>(scene_);
  }
  void on_tick(TimePoint) override {}

 private:
  std::shared_ptr<SceneEntry> scene_ = std::make_shared<SceneEntry>();
};

class PretendedEncoder final : public Encoder {
 public:
  PretendedEncoder(EncoderKind kind, std::atomic<int>* open) : kind_(kind), open_(open) {}
  ~PretendedEncoder() override {
    if (open_) --*open_;
  }
  EncodeStatus encode(const FrameView&, bool force_idr, EncodedFrame& out) noexcept override {
    out.bytes.assign(100, std::byte{0});
    out.idr = force_idr;
    return {};
  }
  void set_rate(int, int) noexcept override {}
  [[nodiscard]] Codec codec() const override { return Codec::h264; }
  [[nodiscard]] std::string_view name() const override { return encoder_name(kind_); }
  [[nodiscard]] std::string codec_string() const override { return "avc1.42C01F"; }

 private:
  const EncoderKind kind_;
  std::atomic<int>* const open_;  // of a kind that is short; null: it is not
};

class RegistryTest : public testing::Test {
 protected:
  void start(const EncoderAllocator::Policy& policy = {}) {
    RegistryOptions options;
    options.devices = devices;
    options.encoders = policy;
    options.min_fps = 0;
    const auto pool = std::make_shared<ThreadPool>(2);
    registry.emplace(
        io, options,
        std::make_shared<PoolExecutor>(PoolExecutor::Pools{pool, pool}, encoder_factory()), scenes,
        std::vector<EncoderChoice>{{EncoderKind::nvenc, Codec::h264, "h264_nvenc"},
                                   {EncoderKind::x264, Codec::h264, "libx264"}},
        [](const auto&, const auto&, Use) { return std::nullopt; }, SessionTokens("a key"),
        metrics);
  }
  void TearDown() override {
    for (auto& client : clients) client.listener->on_close(true);
    if (registry) registry->stop_timers();
    io.run();  // until nothing is under way
    clients.clear();
  }
  EncoderFactory encoder_factory() {
    return [this](EncoderKind kind, const EncoderSettings&) -> std::unique_ptr<Encoder> {
      if (kind != EncoderKind::nvenc) return std::make_unique<PretendedEncoder>(kind, nullptr);
      if (++nvenc_open > nvenc_limit) {
        --nvenc_open;
        throw std::runtime_error("OpenEncodeSessionEx failed: out of memory (10)");
      }
      return std::make_unique<PretendedEncoder>(kind, &nvenc_open);
    };
  }

  struct Visitor {
    std::shared_ptr<OpenConnection> connection;
    std::shared_ptr<ConnectionListener> listener;
    std::uint64_t poses = 0;
  };
  static void say(Visitor& visitor, const v1::ClientMessage& message) {
    const std::string bytes = message.SerializeAsString();
    visitor.listener->on_message(std::as_bytes(std::span(bytes)), {});
  }
  /// A new visitor, who was welcomed or waits.
  Visitor& join() {
    auto connection = std::make_shared<OpenConnection>();
    Visitor& visitor = clients.emplace_back(Visitor{connection, registry->accept(connection)});
    v1::ClientMessage message;
    v1::Hello& hello = *message.mutable_hello();
    hello.set_version(1);
    hello.set_viewport_width_px(160);
    hello.set_viewport_height_px(96);
    hello.set_device_pixel_ratio(1.0f);
    hello.add_decoders(v1::CODEC_H264);
    say(visitor, message);
    run_until([&] { return connection->welcome || connection->waits; });
    return visitor;
  }
  void leave(std::size_t index) {
    clients[index].listener->on_close(true);
    clients.erase(clients.begin() + static_cast<std::ptrdiff_t>(index));
  }
  /// All move until each has so many more frames.
  void move_on(std::size_t frames) {
    std::vector<std::size_t> wanted;
    for (const auto& client : clients) wanted.push_back(client.connection->frames.size() + frames);
    std::vector<std::size_t> acknowledged(clients.size(), 0);
    run_until([&] {
      bool all = true;
      for (std::size_t i = 0; i < clients.size(); ++i) {
        Visitor& visitor = clients[i];
        const auto& received = visitor.connection->frames;
        v1::ClientMessage message;
        for (; acknowledged[i] < received.size(); ++acknowledged[i]) {
          message.mutable_ack()->set_frame_id(received[acknowledged[i]]);
          message.mutable_ack()->set_presented_us(1);
          say(visitor, message);
        }
        v1::PoseSample& pose = *message.mutable_pose();
        pose.set_pose_id(++visitor.poses);
        pose.set_fov_y_rad(1.0f);
        pose.mutable_world_from_camera()->mutable_position()->set_x(
            static_cast<float>(visitor.poses));
        pose.mutable_world_from_camera()->mutable_orientation()->set_w(1.0f);
        say(visitor, message);
        all = all && received.size() >= wanted[i];
      }
      return all;
    });
  }
  /// Throws after twenty seconds: a bound against hanging, not a measurement.
  template <typename Condition>
  void run_until(Condition condition) {
    const TimePoint end = Clock::now() + 20s;
    while (!condition()) {
      if (Clock::now() > end) throw std::runtime_error("nothing happens");
      io.run_for(5ms);
    }
  }
  std::string encoder_of(const Visitor& visitor) const {
    return visitor.connection->welcome ? visitor.connection->welcome->config().encoder() : "";
  }

  std::shared_ptr<DeviceSet> devices = std::make_shared<DeviceSet>(std::vector<int>{});
  std::shared_ptr<PretendedRenderer> renderer = std::make_shared<PretendedRenderer>(devices);
  OneScene scenes{renderer};
  std::atomic<int> nvenc_open{0};
  int nvenc_limit = 100;
  boost::asio::io_context io;
  Metrics metrics;
  std::deque<Visitor> clients;
  std::optional<SessionRegistry> registry;
};

TEST_F(RegistryTest, NewSessionsGoWhereLessWorkIsMeasured) {
  start();
  renderer->frame_ms[0] = 40.0f;
  renderer->frame_ms[1] = 1.0f;
  join();
  join();
  EXPECT_EQ(devices->views(), (std::map<int, int>{{0, 1}, {1, 1}}));
  move_on(60);
  join();
  move_on(60);
  join();
  EXPECT_EQ(devices->views(), (std::map<int, int>{{0, 1}, {1, 3}}))
      << "by their number, one of them would be on device 0";
}

TEST_F(RegistryTest, WhoFindsNoNvencSessionGetsX264) {
  nvenc_limit = 2;
  start();
  EXPECT_EQ(encoder_of(join()), "h264_nvenc");
  EXPECT_EQ(encoder_of(join()), "h264_nvenc");
  EXPECT_EQ(encoder_of(join()), "libx264");
  EXPECT_EQ(metrics.encoders_refused.Value(), 1.0);
  EXPECT_EQ(encoder_of(join()), "libx264");
  EXPECT_EQ(metrics.encoders_refused.Value(), 1.0) << "learnt: the driver is not asked again";
  EXPECT_EQ(nvenc_open, 2);
  move_on(3);

  leave(0);
  run_until([&] { return nvenc_open == 1; });
  EXPECT_EQ(encoder_of(join()), "h264_nvenc");
}

TEST_F(RegistryTest, OrWaitsForOneAsTheOperatorSays) {
  nvenc_limit = 2;
  start({.nvenc_sessions = 2, .queue_for_nvenc = true});
  join();
  join();
  const Visitor& third = join();
  EXPECT_TRUE(third.connection->waits);
  EXPECT_EQ(metrics.encoders_refused.Value(), 0.0);
  const auto connection = third.connection;
  leave(0);
  run_until([&] { return connection->welcome.has_value(); });
  EXPECT_EQ(connection->welcome->config().encoder(), "h264_nvenc");
}

}  // namespace
}  // namespace catgs
