// catgs-load against a real server in this process: counts, decodability, bounded queues. No
// milliseconds: those belong to benchmarks.
#include "tests/load/load.h"

#include <limits>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/error.h"
#include "render_core/motion/trajectory.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tls.h"

namespace catgs::load {
namespace {

using test::RunningServer;

std::string url_of(const RunningServer& server) {
  return "ws://127.0.0.1:" + std::to_string(server.port());
}

LoadOptions small_load(const std::string& url) {
  LoadOptions options;
  options.url = url;
  options.sessions = 3;
  options.script.script = "head";
  options.duration_s = 3.0;
  options.size = "160x90";
  options.fps = 30;
  options.decode = true;
  return options;
}

/// Returns once a session of the server has got a frame. Throws after twenty seconds: a bound
/// against hanging, not a measurement.
void wait_for_frames(const RunningServer& server) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (std::chrono::steady_clock::now() < deadline) {
    const auto sessions =
        nlohmann::json::parse(test::http_get(server.admin_port(), "/api/sessions").body);
    for (const auto& session : sessions)
      if (session.at("frames_sent").get<int>() > 0) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  throw std::runtime_error("no session got a frame");
}

/// What went wrong, for the test's log.
std::string errors_of(const SessionReports& reports) {
  return to_json(reports, collect_metrics(reports, 30.0)).at("error_counts").dump(2);
}

void expect_clean(const SessionReports& reports) {
  for (const auto& report : reports) {
    const SessionStats& stats = report->stats;
    EXPECT_TRUE(stats.connected);
    EXPECT_EQ(stats.errors, 0u) << errors_of(reports);
    EXPECT_EQ(stats.reconnects, 0u);
    EXPECT_GE(stats.frames, 5u);
    EXPECT_GE(stats.idrs, 1u);
    EXPECT_GT(stats.poses_sent, 30u);
    EXPECT_EQ(stats.decode_errors, 0u);
    EXPECT_EQ(stats.frames_skipped, 0u);
    // All but the frames on their way at the end were decoded; credits bound those.
    EXPECT_GE(stats.decode.count() + 8, stats.frames);
    EXPECT_GT(stats.pose_to_frame.count(), 0u);
    EXPECT_GT(stats.pose_age.count(), 0u);
  }
}

TEST(Load, SessionsGetFramesThatDecode) {
  const RunningServer server;
  expect_clean(run_load(small_load(url_of(server))));
}

TEST(Load, MjpegDecodesToo) {
  const RunningServer server([](ServerConfig& config) { config.encoder = EncoderKind::jpeg; });
  const SessionReports reports = run_load(small_load(url_of(server)));
  expect_clean(reports);
  for (const auto& report : reports) EXPECT_THAT(report->encoder, ::testing::HasSubstr("jpeg"));
}

TEST(Load, TlsNeedsATrustedCertificateOrInsecure) {
  const test::TemporaryFolder folder;
  test::write_self_signed(folder / "certificate.pem", folder / "key.pem");
  const RunningServer server([&](ServerConfig& config) {
    config.tls_cert = folder / "certificate.pem";
    config.tls_key = folder / "key.pem";
  });
  LoadOptions options = small_load("wss://127.0.0.1:" + std::to_string(server.port()));
  options.insecure = true;
  expect_clean(run_load(options));
  options.insecure = false;
  const SessionReports refused = run_load(options);
  EXPECT_FALSE(refused[0]->stats.connected);
  EXPECT_THAT(errors_of(refused), ::testing::HasSubstr("certificate verify failed"));
}

TEST(Load, ASilentClientGetsNoMoreFramesThanItsCredit) {
  const RunningServer server;
  LoadOptions options = small_load(url_of(server));
  options.acknowledge = false;
  options.decode = false;
  for (const auto& report : run_load(options)) {
    EXPECT_TRUE(report->stats.connected);
    EXPECT_EQ(report->stats.frames, 1u) << "without a measured round trip one may be in flight";
    EXPECT_GT(report->stats.poses_sent, 30u);
  }
}

TEST(Load, OneSilentClientDisturbsNobody) {
  const RunningServer server;
  LoadOptions silent = small_load(url_of(server));
  silent.acknowledge = false;
  silent.decode = false;
  silent.sessions = 1;
  std::jthread stalled([&] { run_load(silent); });
  expect_clean(run_load(small_load(url_of(server))));
}

TEST(Load, ARefusedSessionDoesNotComeBack) {
  const RunningServer server;
  LoadOptions options = small_load(url_of(server));
  options.scene = "no such scene";
  options.sessions = 1;
  const SessionReports reports = run_load(options);
  EXPECT_FALSE(reports[0]->stats.connected);
  EXPECT_EQ(reports[0]->stats.errors, 1u) << errors_of(reports);
  EXPECT_EQ(reports[0]->stats.reconnects, 0u);
}

TEST(Load, AServerThatIsNotThereIsTriedAgainUntilTheEnd) {
  std::string url;
  {
    const RunningServer server;
    url = url_of(server);  // nobody listens there once it is gone
  }
  LoadOptions options = small_load(url);
  options.sessions = 2;
  const SessionReports reports = run_load(options);
  for (const auto& report : reports) {
    EXPECT_FALSE(report->stats.connected);
    EXPECT_GE(report->stats.reconnects, 1u);
    EXPECT_EQ(report->stats.errors, report->stats.reconnects + 1);
  }
  EXPECT_EQ(collect_metrics(reports, 30.0)[1],
            (std::pair<std::string, double>{"sessions_connected", 0.0}));
}

TEST(Load, AServerThatGoesAwayIsReportedAsLost) {
  auto server = std::make_unique<RunningServer>();
  LoadOptions options = small_load(url_of(*server));
  options.sessions = 1;
  SessionReports reports;
  std::jthread load([&] { reports = run_load(options); });
  wait_for_frames(*server);
  server.reset();
  load.join();
  EXPECT_TRUE(reports[0]->stats.connected);
  EXPECT_GE(reports[0]->stats.errors, 1u);
  EXPECT_GE(reports[0]->stats.reconnects, 1u);
}

TEST(Load, BadOptionsAreToldBeforeAnythingRuns) {
  const auto refused = [](auto change) {
    LoadOptions options = small_load("ws://127.0.0.1:1");
    change(options);
    EXPECT_THROW(run_load(options), InputError);
  };
  refused([](LoadOptions& options) { options.url = "http://x"; });
  refused([](LoadOptions& options) { options.size = "big"; });
  refused([](LoadOptions& options) { options.script.script = "jump"; });
  refused([](LoadOptions& options) { options.script.script = ""; });
  refused([](LoadOptions& options) { options.traces = {"/nonexistent.tum"}; });
  refused([](LoadOptions& options) { options.duration_s = 0.0; });
  const test::TemporaryFolder folder;
  const std::filesystem::path trace = folder / "still.tum";
  write_tum(trace, {{0, Pose()}, {1'000'000, Pose()}});
  for (const double endless_s : {1e30, std::numeric_limits<double>::infinity()}) {
    refused([&](LoadOptions& options) {
      options.script.script = "";
      options.traces = {trace.string()};
      options.duration_s = endless_s;
    });
  }
  refused([](LoadOptions& options) { options.ramp_s = 3.0; });
  refused([](LoadOptions& options) { options.fov_y_deg = 0.0f; });
}

}  // namespace
}  // namespace catgs::load
