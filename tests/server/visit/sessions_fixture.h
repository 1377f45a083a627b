#pragma once

// Sessions with devices and encoders that are not there, and that fail when somebody says so.

#include <deque>

#include "proto/catgs.pb.h"
#include "render_core/cuda/place_view.h"
#include "render_core/frame/device_error.h"
#include "server/frame_path.h"
#include "server/schedule/pool_executor.h"
#include "server/visit/sessions.h"
#include "tests/support/test.h"

namespace catgs::test {

/// A socket that is always read. Session thread only, but for queued frames.
class OpenConnection final : public Connection {
 public:
  explicit OpenConnection(std::string peer_address = "127.0.0.1")
      : peer_address_(std::move(peer_address)) {}
  void send(OutgoingMessage message) override {
    ++messages;
    const std::vector<std::byte>& bytes = message.bytes;
    v1::ServerMessage parsed;
    if (!parsed.ParseFromArray(bytes.data() + 1, static_cast<int>(bytes.size()) - 1))
      throw std::logic_error("no ServerMessage");
    if (parsed.has_welcome()) welcome = parsed.welcome();
    if (parsed.has_config()) config = parsed.config();
    if (parsed.has_error()) {
      error = parsed.error();
      ++errors;
    }
    if (parsed.has_heartbeat()) ++heartbeats;
    if (parsed.has_lead()) lead = parsed.lead();
    if (parsed.has_pinged()) pinged.push_back(parsed.pinged());
    if (parsed.has_company()) companies.push_back(parsed.company());
    waits = parsed.has_queue();
    if (waits) estimate_s = parsed.queue().estimate_s();
  }
  std::vector<std::uint64_t> send(OutgoingFrame frame) override {
    if (full) return {frame.ticket.frame_id};
    frames.push_back(frame.ticket.frame_id);
    idrs += frame.ticket.idr ? 1 : 0;
    return {};
  }
  void close(CloseCode code, std::string_view) override { closed = code; }
  [[nodiscard]] std::string peer_address() const override { return peer_address_; }
  [[nodiscard]] std::size_t queued_frames() const override { return 0; }

  int messages = 0;
  bool full = false;  // of frames that are not read
  std::optional<v1::Welcome> welcome;
  std::optional<v1::StreamConfig> config;  // after that of the welcome
  std::optional<v1::Error> error;
  int errors = 0;
  std::optional<CloseCode> closed;
  bool waits = false;
  std::uint32_t estimate_s = 0;  // of a wait
  int heartbeats = 0;
  std::optional<v1::Lead> lead;
  std::vector<v1::Pinged> pinged;
  std::vector<v1::Company> companies;
  std::vector<std::uint64_t> frames;
  int idrs = 0;

 private:
  const std::string peer_address_;
};

/// Two devices on which a frame takes as long as somebody says, and ends as somebody says.
class PretendedRenderer final : public Renderer {
 public:
  explicit PretendedRenderer(std::shared_ptr<DeviceSet> devices) : devices_(std::move(devices)) {}
  [[nodiscard]] std::string description() const override { return "pretended"; }
  [[nodiscard]] std::size_t scene_bytes() const override { return 0; }
  [[nodiscard]] std::unique_ptr<View> make_view(const ViewSettings&) override {
    return place_view(*devices_, {0, 1}, [this](DeviceSet::Slot slot) {
      const auto device = static_cast<std::size_t>(slot.device());
      if (lost[device]) throw DeviceError(RenderStatus::Code::device_failed, "stream: " + fault);
      if (full[device])
        throw DeviceError(RenderStatus::Code::out_of_memory, "lists: out of memory");
      ++views_made;
      return std::make_unique<PretendedView>(*this, std::move(slot));
    });
  }

  std::array<std::atomic<float>, 2> frame_ms{};
  std::array<std::atomic<bool>, 2> lost{};  // as after a kernel error: nothing works on it any more
  std::array<std::atomic<bool>, 2> full{};  // for another View
  std::atomic<int> frames_without_memory{0};
  std::atomic<bool> outdated{false};  // pages have come since the last frame
  std::atomic<int> views_made{0};
  std::function<void(int device)> before_frame = [](int) {};  // set before the first frame
  const std::string fault = "an illegal memory access was encountered";

 private:
  class PretendedView final : public View {
   public:
    PretendedView(PretendedRenderer& renderer, DeviceSet::Slot slot)
        : renderer_(renderer), slot_(std::move(slot)) {}
    RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override {
      const auto device = static_cast<std::size_t>(slot_.device());
      renderer_.before_frame(slot_.device());
      if (renderer_.lost[device])
        return {RenderStatus::Code::device_failed, "blend: " + renderer_.fault};
      if (int left = renderer_.frames_without_memory; left > 0) {
        renderer_.frames_without_memory = left - 1;
        return {RenderStatus::Code::out_of_memory, "blend: out of memory"};
      }
      frame.size_px = request.camera.size_px;
      renderer_.outdated = false;
      frame.stats.stage_ms[0] = renderer_.frame_ms[device];
      return {};
    }
    [[nodiscard]] std::size_t memory_bytes() const override { return 0; }
    [[nodiscard]] bool outdated() const override { return renderer_.outdated; }
    [[nodiscard]] std::optional<int> device() const override { return slot_.device(); }

   private:
    PretendedRenderer& renderer_;
    DeviceSet::Slot slot_;
  };

  const std::shared_ptr<DeviceSet> devices_;
};

/// One scene, always in memory, by any name but "attic", which is another one.
class OneScene final : public SceneSource {
 public:
  explicit OneScene(std::shared_ptr<Renderer> renderer) {
    scene_->renderer = std::move(renderer);
    scene_->facts.near_z = 0.2f;
    *attic_ = *scene_;
    attic_->facts.scene_id = "attic";
  }
  [[nodiscard]] std::vector<std::string> scene_ids() const override { return ids; }
  [[nodiscard]] bool has(const std::string&) const override { return true; }
  SceneAnswer want(const std::string& id, TimePoint) override {
    return std::shared_ptr<const SceneEntry>(id == "attic" ? attic_ : scene_);
  }
  void prepare(const std::string& id, TimePoint) override { prepared.push_back(id); }
  void on_tick(TimePoint) override {}
  /// Before anybody comes.
  void give_tours(std::string_view document) { scene_->tours = ToursAnswers(document); }

  std::vector<std::string> prepared;
  std::vector<std::string> ids = {"scene"};

 private:
  std::shared_ptr<SceneEntry> scene_ = std::make_shared<SceneEntry>();
  std::shared_ptr<SceneEntry> attic_ = std::make_shared<SceneEntry>();
};

/// What encoders of the test share.
struct EncoderState {
  std::atomic<int> nvenc_open{0};
  std::atomic<int> opened{0};
  std::atomic<int> frames_that_fail{0};
};

class PretendedEncoder final : public Encoder {
 public:
  PretendedEncoder(EncoderKind kind, EncoderState& state) : kind_(kind), state_(state) {
    ++state_.opened;
  }
  ~PretendedEncoder() override {
    if (kind_ == EncoderKind::nvenc) --state_.nvenc_open;
  }
  EncodeStatus encode(const FrameView&, bool force_idr, EncodedFrame& out) noexcept override {
    if (int left = state_.frames_that_fail; left > 0) {
      state_.frames_that_fail = left - 1;
      return {false, std::string(name()) + ": the driver was reset"};
    }
    out.bytes.assign(100, std::byte{0});
    const bool first = std::exchange(first_, false);
    out.idr = force_idr || first;
    return {};
  }
  void set_rate(int, int) noexcept override {}
  [[nodiscard]] Codec codec() const override { return Codec::h264; }
  [[nodiscard]] std::string_view name() const override { return encoder_name(kind_); }
  [[nodiscard]] std::string codec_string() const override { return "avc1.42C01F"; }

 private:
  const EncoderKind kind_;
  EncoderState& state_;
  bool first_ = true;
};

/// Counts how often which session was asked for its next frame.
class CountedFrames final : public FramePath {
 public:
  using FramePath::FramePath;
  void changed(Session& session) override {
    ++asked[&session];
    FramePath::changed(session);
  }
  std::map<const Session*, int> asked;
};

class SessionsTest : public testing::Test {
 protected:
  SessionsTest() { options.min_fps = 0; }
  void start() {
    const auto executor = std::make_shared<PoolExecutor>(
        PoolExecutor::Pools{std::make_shared<ThreadPool>(pool_threads)}, encoder_factory());
    frame_path.emplace(io, executor, static_cast<int>(devices->views().size()), on_devices_lost,
                       metrics);
    sessions.emplace(VisitContext{io, options, executor, *devices, *frame_path, scenes, encoders,
                                  authorize, SessionTokens("a key"), metrics, &counts});
  }
  void TearDown() override {
    for (auto& client : clients) client.listener->on_close(true);
    if (sessions) sessions->stop_timer();
    io.restart();
    io.run();  // until nothing is under way
    clients.clear();
  }
  EncoderFactory encoder_factory() {
    return [this](EncoderKind kind, const EncoderSettings&) -> std::unique_ptr<Encoder> {
      if (kind == EncoderKind::nvenc && ++encoding.nvenc_open > nvenc_limit) {
        --encoding.nvenc_open;
        throw std::runtime_error("OpenEncodeSessionEx failed: out of memory (10)");
      }
      return std::make_unique<PretendedEncoder>(kind, encoding);
    };
  }

  struct Visitor {
    std::shared_ptr<OpenConnection> connection;
    std::shared_ptr<ConnectionListener> listener;
    std::uint64_t poses = 0;
    std::size_t acknowledged = 0;
  };
  static void say(Visitor& visitor, const v1::ClientMessage& message) {
    const std::string bytes = message.SerializeAsString();
    visitor.listener->on_message(std::as_bytes(std::span(bytes)), {});
  }
  /// A new visitor, who was welcomed, refused or waits.
  Visitor& join(
      const std::string& resume_token = {}, const std::string& from = "192.0.2.1",
      const std::function<void(v1::Hello&)>& request = [](v1::Hello&) {}) {
    auto connection = std::make_shared<OpenConnection>(from);
    Visitor& visitor = clients.emplace_back(Visitor{connection, sessions->accept(connection)});
    v1::ClientMessage message;
    v1::Hello& hello = *message.mutable_hello();
    hello.set_version(1);
    hello.set_viewport_width_px(160);
    hello.set_viewport_height_px(96);
    hello.add_decoders(v1::CODEC_H264);
    if (!resume_token.empty()) hello.mutable_resume()->set_token(resume_token);
    request(hello);
    say(visitor, message);
    run_until([&] { return connection->welcome || connection->waits || connection->closed; });
    return visitor;
  }
  /// `by_leaving` false: the socket is lost, and the session waits.
  void leave(std::size_t index, bool by_leaving = true) {
    clients[index].listener->on_close(by_leaving);
    clients.erase(clients.begin() + static_cast<std::ptrdiff_t>(index));
  }
  static void acknowledge(Visitor& visitor) {
    const auto& received = visitor.connection->frames;
    v1::ClientMessage message;
    for (; visitor.acknowledged < received.size(); ++visitor.acknowledged) {
      message.mutable_ack()->set_frame_id(received[visitor.acknowledged]);
      message.mutable_ack()->set_presented_us(1);
      say(visitor, message);
    }
  }
  /// A step of the visitor: acknowledgements, and another pose.
  /// `view_height`: of an orthographic view; 0: perspective.
  static void move(Visitor& visitor, float view_height = 0.0f) {
    acknowledge(visitor);
    v1::ClientMessage message;
    v1::PoseSample& pose = *message.mutable_pose();
    pose.set_pose_id(++visitor.poses);
    pose.set_fov_y_rad(1.0f);
    pose.set_view_height(view_height);
    pose.mutable_world_from_camera()->mutable_position()->set_x(static_cast<float>(visitor.poses));
    pose.mutable_world_from_camera()->mutable_orientation()->set_w(1.0f);
    say(visitor, message);
  }
  /// All that are connected move until it holds.
  template <typename Condition>
  void move_until(Condition condition) {
    run_until([&] {
      for (Visitor& visitor : clients)
        if (!visitor.connection->closed) move(visitor);
      return condition();
    });
  }
  /// All move until each that is not closed has so many more frames.
  void move_on(std::size_t frames) {
    std::vector<std::size_t> wanted;
    for (const auto& client : clients) wanted.push_back(client.connection->frames.size() + frames);
    move_until([&] {
      for (std::size_t i = 0; i < clients.size(); ++i)
        if (!clients[i].connection->closed && clients[i].connection->frames.size() < wanted[i])
          return false;
      return true;
    });
  }
  /// Also where nothing was left to wait for at the end of an earlier call.
  void run_for(std::chrono::milliseconds time) {
    io.restart();
    io.run_for(time);
  }
  /// Throws after twenty seconds: a bound against hanging, not a measurement.
  template <typename Condition>
  void run_until(Condition condition) {
    const TimePoint end = Clock::now() + 20s;
    while (!condition()) {
      if (Clock::now() > end) throw std::runtime_error("nothing happens");
      run_for(5ms);
    }
  }
  std::string encoder_of(const Visitor& visitor) const {
    return visitor.connection->welcome ? visitor.connection->welcome->config().encoder() : "";
  }

  std::shared_ptr<DeviceSet> devices = std::make_shared<DeviceSet>(std::vector<int>{});
  std::shared_ptr<PretendedRenderer> renderer = std::make_shared<PretendedRenderer>(devices);
  OneScene scenes{renderer};
  EncoderState encoding;
  int nvenc_limit = 100;
  int pool_threads = 2;
  VisitOptions options;
  DeviceFailures::OnLost on_devices_lost = [](const auto&) {};
  Authorize authorize = [](const auto&) { return Permit{[](auto, Use) { return std::nullopt; }}; };
  std::vector<EncoderChoice> encoders = {{EncoderKind::nvenc, Codec::h264, "h264_nvenc"},
                                         {EncoderKind::x264, Codec::h264, "libx264"}};
  boost::asio::io_context io;
  Metrics metrics;
  VisitCounts counts{unix_now_s};
  std::deque<Visitor> clients;
  std::optional<CountedFrames> frame_path;
  std::optional<Sessions> sessions;
};

}  // namespace catgs::test
