// Integration: a whole server under which something fails.

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "render_core/base/device_set.h"
#include "render_core/base/thread_pool.h"
#include "render_core/cuda/cuda_renderer.h"
#include "render_core/scene/files/save_scene.h"
#include "server/base/log.h"
#include "server/scenes/scene_library.h"
#include "server/schedule/frame_executor.h"
#include "tests/render_core/scene/random_cloud.h"
#include "tests/support/descriptor_limit.h"
#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

/// An executor around the working one.
class WrappedExecutor : public FrameExecutor {
 public:
  explicit WrappedExecutor(std::shared_ptr<FrameExecutor> working) : working_(std::move(working)) {}
  [[nodiscard]] int slots() const override { return working_->slots(); }
  void open(std::shared_ptr<Stream> stream, StreamSettings settings,
            std::function<void(StreamOpened)> done) override {
    working_->open(std::move(stream), std::move(settings), std::move(done));
  }
  void submit(FrameJob job, std::function<void(FrameResult)> done) override {
    working_->submit(std::move(job), std::move(done));
  }
  void close(std::shared_ptr<Stream> stream) override { working_->close(std::move(stream)); }

 private:
  const std::shared_ptr<FrameExecutor> working_;
};

/// What a GPU does after a kernel error: nothing, and it says so.
class FailingExecutor final : public WrappedExecutor {
 public:
  FailingExecutor(std::shared_ptr<FrameExecutor> working, const std::atomic<bool>& fails)
      : WrappedExecutor(std::move(working)), fails_(fails) {}
  void open(std::shared_ptr<Stream> stream, StreamSettings settings,
            std::function<void(StreamOpened)> done) override {
    if (!fails_)
      return WrappedExecutor::open(std::move(stream), std::move(settings), std::move(done));
    StreamOpened refused;
    refused.fault = Fault::device_failed;
    refused.message = "stream: an illegal memory access was encountered";
    done(std::move(refused));
  }
  void submit(FrameJob job, std::function<void(FrameResult)> done) override {
    if (!fails_) return WrappedExecutor::submit(std::move(job), std::move(done));
    FrameResult failed;
    failed.frame.ticket = job.ticket;
    failed.fault = Fault::device_failed;
    failed.message = "blend: an illegal memory access was encountered";
    done(std::move(failed));
  }

 private:
  const std::atomic<bool>& fails_;
};

TEST(ServerFaults, EndsForItsSupervisorWhenNoDeviceRendersAnyMore) {
  std::atomic<bool> fails{false};
  const ServerConfig config = quiet_config();
  ServerParts parts;
  parts.wrap = [&](std::shared_ptr<FrameExecutor> executor) {
    return std::make_shared<FailingExecutor>(std::move(executor), fails);
  };
  Server server(config, parts);
  auto ended = std::async(std::launch::async, [&] { server.run(); });
  const Stopped stopped(server);
  WireClient looks(server.port());
  looks.greet();
  looks.send_pose(1);
  looks.send_ack(looks.receive_frame().header.frame_id());
  WireClient stands(server.port());
  stands.greet();
  fails = true;
  looks.send_pose(2, 1.0f);
  std::optional<v1::Error> error;
  Received last;
  // A slow machine has refined the first picture: without acknowledgement there is no next frame.
  while (!(last = looks.receive()).closed) {
    if (last.frame) looks.send_ack(last.frame->header.frame_id());
    if (last.message && last.message->has_error()) error = last.message->error();
  }
  EXPECT_EQ(last.close_code, 1013);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), v1::Error::INTERNAL) << "its page comes again, to whom serves then";
  EXPECT_GT(stands.receive_message(v1::ServerMessage::kDrain).drain().deadline_ms(), 0u);
  EXPECT_THAT([&] { ended.get(); },  // main() makes it exit status 1
              ThrowsMessage<std::runtime_error>(
                  HasSubstr("no device renders any more: stream: an illegal memory")));
}

/// Keeps the next frame, as a GPU call does that never returns, or the thread that submits it.
class StuckExecutor final : public WrappedExecutor {
 public:
  using WrappedExecutor::WrappedExecutor;
  void submit(FrameJob job, std::function<void(FrameResult)> done) override {
    if (keeps_the_frame.exchange(false))
      kept_ = [this, job, done] { WrappedExecutor::submit(job, done); };
    else
      WrappedExecutor::submit(std::move(job), std::move(done));
    if (keeps_the_thread.exchange(false)) released_.get_future().wait();
  }
  void release_thread() { released_.set_value(); }
  void release_frame() { std::exchange(kept_, nullptr)(); }

  std::atomic<bool> keeps_the_frame{false};
  std::atomic<bool> keeps_the_thread{false};

 private:
  std::function<void()> kept_;
  std::promise<void> released_;
};

TEST(ServerFaults, ProbesNameTheThreadThatStandsStill) {
  std::atomic<Clock::duration> later{0s};
  ServerParts parts;
  parts.liveness_clock = [&] { return Clock::now() + later.load(); };
  std::shared_ptr<StuckExecutor> stuck;
  parts.wrap = [&](std::shared_ptr<FrameExecutor> executor) {
    return stuck = std::make_shared<StuckExecutor>(std::move(executor));
  };
  ServerConfig config = quiet_config();
  config.admin_bind = "127.0.0.1:0";
  Server server(config, parts);
  auto ended = std::async(std::launch::async, [&] { server.run(); });
  const Stopped stopped(server);
  const auto healthy = [&] {
    return http_get(server.port(), "/healthz").status == 200 &&
           http_get(server.admin_port(), "/readyz").status == 200;
  };
  const auto complaint = [&] { return http_get(server.admin_port(), "/healthz").body; };
  EXPECT_TRUE(healthy());
  WireClient client(server.port());
  client.greet();

  stuck->keeps_the_frame = true;
  client.send_pose(1);
  ASSERT_TRUE(eventually([&] { return !stuck->keeps_the_frame; }));
  later = 29s;
  EXPECT_TRUE(eventually(healthy)) << "a slow frame";
  later = 60s;
  EXPECT_TRUE(eventually([&] { return complaint().starts_with("frames stalled for 6"); }));
  EXPECT_EQ(http_get(server.admin_port(), "/healthz").status, 503);
  EXPECT_EQ(http_get(server.port(), "/readyz").status, 503) << "proxies send nobody any more";
  EXPECT_THAT(http_get(server.admin_port(), "/metrics").body,
              HasSubstr("\ncatgs_loop_stalled_seconds{loop=\"frames\"} 6"));
  stuck->release_frame();
  client.send_ack(client.receive_frame().header.frame_id());
  EXPECT_TRUE(eventually(healthy));

  stuck->keeps_the_thread = true;
  client.send_pose(2, 1.0f);
  ASSERT_TRUE(eventually([&] { return !stuck->keeps_the_thread; }));
  EXPECT_TRUE(healthy()) << "it has moved lately";
  later = 80s;
  EXPECT_THAT(complaint(), StartsWith("session stalled for 2"));
  EXPECT_EQ(http_get(server.port(), "/healthz").status, 503);
  stuck->release_thread();
  EXPECT_TRUE(eventually(healthy));
}

TEST(ServerFaults, KeepsDescriptorsForItsWorkWhenACrowdTakesTheRest) {
  const RunningServer server;
  WireClient visitor(server.port());
  visitor.greet();
  const auto refused = [&] { return metric(server, "catgs_requests_refused_total"); };
  const auto answers = [&] {
    RawSocket socket(server.port());
    socket.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    std::string received;
    return socket.receive_until("200", received);
  };
  constexpr int others = 40;
  const DescriptorLimit limit(next_descriptor() + others + 64);
  for (int i = 0; i < 2 * others; ++i)
    ASSERT_TRUE(eventually(answers)) << "those that are gone do not count";
  const double refused_before = refused();
  {
    std::vector<RawSocket> crowd;
    int served = 0;
    for (int i = 0; i < others; ++i) {
      crowd.emplace_back(server.port());
      crowd.back().send(handshake(server.port()));
      std::string received;
      served += crowd.back().receive_until(" 101 ", received) ? 1 : 0;
    }
    // Each takes two: this process is its client, too.
    EXPECT_GT(served, 0);
    EXPECT_LE(served, others / 2);
    EXPECT_EQ(refused() - refused_before, others - served) << "the admin port answers";
    visitor.send_pose(1);
    visitor.receive_frame();
  }
  EXPECT_TRUE(eventually(answers));
}

/// A library under --renderer auto whose first scene the processors render, and what it answers
/// when it has tried to load another one.
class SecondScene : public testing::Test {
 protected:
  void SetUp() override {
    if (cuda_obstacle().empty()) GTEST_SKIP() << "a GPU is here, and would take them";
  }
  SceneAnswer wanted_later() {
    save_scene(random_cloud(100, 0), folder_ / "attic.ply");
    ServerConfig config;
    config.scenes = {"synth:city:2000"};
    config.scene_folders = {folder_.path()};
    Background background;
    boost::asio::io_context io;
    const auto waits = boost::asio::make_work_guard(io);
    SceneLibrary library(
        config, {RendererKind::automatic, std::make_shared<ThreadPool>(1), "auto", devices_},
        background, io, metrics_);
    const std::string attic = library.resolve("attic");
    EXPECT_TRUE(std::holds_alternative<SceneAwaited>(library.want(attic, Clock::now())));
    const TimePoint end = Clock::now() + std::chrono::seconds(20);  // a bound against hanging
    while (metrics_.scene_loads_failed.Value() + metrics_.scenes_loaded.Value() == 0 &&
           Clock::now() < end)
      io.run_for(std::chrono::milliseconds(5));
    return library.want(attic, Clock::now());
  }

  const TemporaryFolder folder_;
  const std::shared_ptr<DeviceSet> devices_ = std::make_shared<DeviceSet>(std::vector<int>{});
  Metrics metrics_;
};

TEST_F(SecondScene, IsNotLeftToTheProcessorsWhenNoGpuTakesIt) {
  devices_->add(0);  // as the CUDA core does that renders the first scene
  EXPECT_TRUE(std::holds_alternative<ErrorMessage>(wanted_later()));
  EXPECT_EQ(metrics_.scene_loads_failed.Value(), 1.0);
}

TEST_F(SecondScene, StaysWithTheProcessorsAfterAFirstThatNoGpuTook) {
  const SceneAnswer answer = wanted_later();
  const auto* entry = std::get_if<std::shared_ptr<const SceneEntry>>(&answer);
  ASSERT_TRUE(entry);
  EXPECT_THAT((*entry)->renderer_text, AllOf(HasSubstr("CPU"), HasSubstr("asked for")))
      << "a GPU that is found meanwhile has no threads and no budget here";
}

/// The server's log goes to a full disk for as long as it lives.
class FullDiskOfTheLog {
 public:
  FullDiskOfTheLog() {
    const int full = ::open("/dev/full", O_WRONLY);
    ::dup2(full, STDERR_FILENO);
    ::close(full);
    set_up_log("json", "info");
  }
  ~FullDiskOfTheLog() {
    spdlog::drop("catgs-server");
    spdlog::set_default_logger(logger_);
    ::dup2(kept_, STDERR_FILENO);
    ::close(kept_);
  }
  FullDiskOfTheLog(const FullDiskOfTheLog&) = delete;
  FullDiskOfTheLog& operator=(const FullDiskOfTheLog&) = delete;

 private:
  const int kept_ = ::dup(STDERR_FILENO);
  const std::shared_ptr<spdlog::logger> logger_ = spdlog::default_logger();
};

TEST(ServerFaults, ServesWhileTheDiskOfTheLogIsFull) {
  const FullDiskOfTheLog full;
  RunningServer server;
  WireClient client(server.port());
  client.greet();
  client.send_pose(1);
  client.receive_frame();
  const std::string metrics = http_get(server.admin_port(), "/metrics").body;
  EXPECT_THAT(metrics, HasSubstr("\ncatgs_log_lines_lost_total "));
  EXPECT_EQ(metrics.find("\ncatgs_log_lines_lost_total 0\n"), std::string::npos);
}

}  // namespace
}  // namespace catgs::test
