// catgs-load against a real server in this process: counts, decodability, bounded queues. No
// milliseconds: those belong to benchmarks.
#include "tests/load/load.h"

#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/motion/trajectory.h"
#include "tests/load/display_check.h"
#include "tests/load/record.h"
#include "tests/load/report.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"
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
  options.duration_s = 3.0;
  GroupOptions& group = options.groups.emplace_back();
  group.sessions = 3;
  group.script.script = "head";
  group.sizes = {"160x90"};
  group.wishes.fps = 30;
  group.manners.decode = true;
  return options;
}

/// A small load with changes, on a server of its own.
template <typename Change>
RunReport run_small_load(Change change) {
  const RunningServer server;
  LoadOptions options = small_load(url_of(server));
  change(options, options.groups[0]);
  return run_load(options);
}

/// A server with a certificate that nobody trusts.
class TlsServer {
 public:
  [[nodiscard]] std::string url() const {
    return "wss://127.0.0.1:" + std::to_string(server_.port());
  }

 private:
  const test::TemporaryFolder folder_;
  const RunningServer server_{[this](ServerConfig& config) {
    config.tls_cert = folder_ / "certificate.pem";
    config.tls_key = folder_ / "key.pem";
    test::write_self_signed(config.tls_cert, config.tls_key);
  }};
};

struct RecordedRun {
  RunReport run;
  Trajectory poses;
};

/// A session that looks at the server through a recorder.
RecordedRun record_a_run(const std::string& url, bool insecure) {
  LoadOptions options = small_load("");
  options.groups[0].sessions = 1;
  options.duration_s = 2.0;
  RecordedRun recorded;
  std::jthread load;
  RecordOptions record;
  record.url = url;
  record.insecure = insecure;
  record.listen = 0;
  record.duration_s = 3.0;
  record.on_listening = [&](std::uint16_t port) {
    load = std::jthread([&recorded, options, port]() mutable {
      options.url = "ws://127.0.0.1:" + std::to_string(port);
      recorded.run = run_load(options);
    });
  };
  recorded.poses = record_poses(record);
  load.join();
  return recorded;
}

/// What went wrong, for the test's log.
std::string errors_of(const RunReport& run) {
  return to_json(run, collect_metrics(run, {}), {}).at("groups")[0].at("error_counts").dump(2);
}

void expect_clean(const RunReport& run) {
  for (const auto& report : run.groups.at(0).sessions) {
    const SessionStats& stats = report->stats;
    EXPECT_TRUE(stats.connected);
    EXPECT_EQ(stats.counts.errors, 0u) << errors_of(run);
    EXPECT_EQ(stats.counts.reconnects, 0u);
    EXPECT_EQ(stats.durations.admission.count(), 1u);
    EXPECT_GE(stats.counts.frames, 5u);
    EXPECT_GE(stats.counts.idrs, 1u);
    EXPECT_GT(stats.counts.poses_sent, 30u);
    EXPECT_EQ(stats.counts.decode_errors, 0u);
    EXPECT_EQ(stats.counts.frames_skipped, 0u);
    // All but the frames on their way at the end were decoded; credits bound those.
    EXPECT_GE(stats.durations.decode.count() + 8, stats.counts.frames);
    EXPECT_GT(stats.durations.pose_to_frame.count(), 0u);
    EXPECT_GT(stats.durations.pose_age.count(), 0u);
  }
}

TEST(Load, SessionsGetFramesThatDecode) {
  const RunningServer server;
  expect_clean(run_load(small_load(url_of(server))));
}

TEST(Load, MjpegDecodesToo) {
  const RunningServer server([](ServerConfig& config) { config.encoder = EncoderKind::jpeg; });
  const RunReport run = run_load(small_load(url_of(server)));
  expect_clean(run);
  for (const auto& report : run.groups[0].sessions) EXPECT_THAT(report->encoder, HasSubstr("jpeg"));
}

TEST(Load, TlsNeedsATrustedCertificateOrInsecure) {
  const TlsServer server;
  LoadOptions options = small_load(server.url());
  options.insecure = true;
  expect_clean(run_load(options));
  options.insecure = false;
  const RunReport refused = run_load(options);
  EXPECT_FALSE(refused.groups[0].sessions[0]->stats.connected);
  EXPECT_THAT(errors_of(refused), HasSubstr("certificate verify failed"));
}

TEST(Load, ASilentClientGetsNoMoreFramesThanItsCredit) {
  // One frame is too few for what --min-fps goes by.
  const RunningServer server([](ServerConfig& config) { config.min_fps = 0; });
  LoadOptions options = small_load(url_of(server));
  options.groups[0].manners.acknowledge = false;
  options.groups[0].manners.decode = false;
  const RunReport run = run_load(options);
  for (const auto& report : run.groups[0].sessions) {
    EXPECT_TRUE(report->stats.connected);
    EXPECT_EQ(report->stats.counts.frames, 1u)
        << "without a measured round trip one may be in flight";
    EXPECT_GT(report->stats.counts.poses_sent, 30u);
  }
}

TEST(Load, OneSilentClientDisturbsNobody) {
  const RunningServer server;
  LoadOptions silent = small_load(url_of(server));
  silent.groups[0].manners.acknowledge = false;
  silent.groups[0].manners.decode = false;
  silent.groups[0].sessions = 1;
  std::jthread stalled([&] { run_load(silent); });
  expect_clean(run_load(small_load(url_of(server))));
}

TEST(Load, ARefusedSessionDoesNotComeBack) {
  const RunReport run = run_small_load([](LoadOptions&, GroupOptions& group) {
    group.wishes.scene = "no such scene";
    group.sessions = 1;
  });
  EXPECT_FALSE(run.groups[0].sessions[0]->stats.connected);
  EXPECT_EQ(run.groups[0].sessions[0]->stats.counts.errors, 1u) << errors_of(run);
  EXPECT_EQ(run.groups[0].sessions[0]->stats.counts.reconnects, 0u);
}

TEST(Load, AServerThatIsNotThereIsTriedAgainUntilTheEnd) {
  std::string url;
  {
    const RunningServer server;
    url = url_of(server);  // nobody listens there once it is gone
  }
  LoadOptions options = small_load(url);
  options.groups[0].sessions = 2;
  const RunReport run = run_load(options);
  for (const auto& report : run.groups[0].sessions) {
    EXPECT_FALSE(report->stats.connected);
    EXPECT_GE(report->stats.counts.reconnects, 1u);
    EXPECT_EQ(report->stats.counts.errors, report->stats.counts.reconnects + 1);
  }
  EXPECT_EQ(value_of(collect_metrics(run, {}), "sessions_connected"), 0.0);
}

TEST(Load, AServerThatGoesAwayIsReportedAsLost) {
  auto server = std::make_unique<RunningServer>();
  LoadOptions options = small_load(url_of(*server));
  options.groups[0].sessions = 1;
  RunReport run;
  std::jthread load([&] { run = run_load(options); });
  EXPECT_TRUE(
      test::eventually([&] { return test::metric(*server, "catgs_frames_sent_total") > 0; }));
  server.reset();
  load.join();
  EXPECT_TRUE(run.groups[0].sessions[0]->stats.connected);
  EXPECT_GE(run.groups[0].sessions[0]->stats.counts.errors, 1u);
  EXPECT_GE(run.groups[0].sessions[0]->stats.counts.reconnects, 1u);
}

TEST(Load, SessionsComeBackWhenTheirSocketsAreDropped) {
  const RunReport run = run_small_load(
      [](LoadOptions&, GroupOptions& group) { group.manners.reconnect_every_s = 1.0; });
  for (const auto& report : run.groups[0].sessions) {
    EXPECT_EQ(report->stats.counts.reconnects, 2u) << "at 1 and 2 s of 3";
    EXPECT_GE(report->stats.durations.recovery.count(), 1u);
    EXPECT_EQ(report->stats.counts.errors, 0u) << errors_of(run);
    EXPECT_EQ(report->stats.counts.decode_errors, 0u);
  }
}

TEST(Load, AStalledClientGoesOnWhereItStopped) {
  expect_clean(run_small_load([](LoadOptions&, GroupOptions& group) {
    group.manners.stall_at_s = 1.0;
    group.manners.stall_for_s = 0.5;
  }));
}

TEST(Load, AStallWithoutAnEndEndsWithTheRun) {
  const RunReport run = run_small_load([](LoadOptions& options, GroupOptions& group) {
    options.duration_s = 2.0;
    group.manners.stall_at_s = 1.0;
    group.manners.stall_for_s = 7 * 24 * 3600.0;
  });  // or the test's time limit ends it
  for (const auto& report : run.groups[0].sessions) {
    EXPECT_TRUE(report->stats.connected);
    EXPECT_EQ(report->stats.counts.decode_errors, 0u);
  }
}

TEST(Load, AFloodingClientIsTurnedAwayAndDisturbsNobody) {
  const RunningServer server;
  LoadOptions options = small_load(url_of(server));
  GroupOptions flood = options.groups[0];
  flood.name = "flood";
  flood.sessions = 1;
  flood.manners.flood_hz = 5000;
  options.groups.push_back(flood);
  const RunReport run = run_load(options);
  expect_clean(run);
  EXPECT_GE(run.groups[1].sessions[0]->stats.error_counts.at("the server says: too many messages"),
            1u);
}

TEST(Load, ALinkDelaysButLosesNothing) {
  const RunReport run = run_small_load([](LoadOptions&, GroupOptions& group) {
    group.link = parse_link("", "rate=20mbit,delay=20ms,jitter=5ms,loss=1%,burst=2");
  });
  expect_clean(run);
  for (const auto& report : run.groups[0].sessions) {
    EXPECT_GE(report->stats.durations.pose_to_frame.percentile_ms(0.0), 40.0)
        << "no frame answers before a round trip";
  }
}

TEST(Record, SavesThePosesThatPassBy) {
  const RunningServer server;
  const auto [run, poses] = record_a_run(url_of(server), false);
  expect_clean(run);
  EXPECT_EQ(poses.size(), run.groups[0].sessions[0]->stats.counts.poses_sent);
  EXPECT_EQ(poses.at(0).time_us, 0);
}

TEST(Record, GoesOverTlsAndTrustsNoUnknownCertificate) {
  const TlsServer server;
  for (const bool insecure : {true, false}) {
    const auto [run, poses] = record_a_run(server.url(), insecure);
    const SessionStats& stats = run.groups[0].sessions[0]->stats;
    EXPECT_EQ(stats.connected, insecure);
    EXPECT_EQ(poses.size(), insecure ? stats.counts.poses_sent : 0u);
  }
}

TEST(Load, DecodesJustThePicturesThatAreKept) {
  const RunReport run = run_small_load([](LoadOptions& options, GroupOptions& group) {
    options.pictures = 6;
    group.manners.only_pictures = true;
  });
  for (const auto& report : run.groups[0].sessions) {
    EXPECT_EQ(report->pictures.size(), 2u);
    EXPECT_EQ(report->stats.counts.decode_errors, 0u);
    EXPECT_EQ(report->stats.counts.frames_skipped, 0u) << "what is not decoded is not missed";
    EXPECT_GE(report->stats.durations.decode.count(), 2u);
    EXPECT_LT(report->stats.durations.decode.count(), report->stats.counts.frames / 2);
    EXPECT_LE(report->stats.counts.idrs, 1u + 2 * 4) << "one for each, and what asking takes";
  }
}

TEST(Load, TheReportSaysWhatAVisitorSaw) {
  const std::string scene = "synth:city:20000";
  const RunningServer server([&](ServerConfig& config) { config.scenes = {scene}; });
  LoadOptions options = small_load(url_of(server));
  GroupOptions& group = options.groups[0];
  group.sessions = 1;
  group.script.script = "walk";
  group.display.judged = true;
  group.manners.move_for_s = 1.0;
  group.manners.rest_for_s = 0.5;
  RunReport run = run_load(options);
  expect_clean(run);
  check_displays({.scenes = {scene}, .every = 10}, run);
  const Metrics metrics = collect_metrics(run, {});
  const auto json = to_json(run, metrics, {});
  const auto& display = json.at("groups")[0].at("per_session")[0].at("display");
  const std::size_t judged = display.at("at_s").size();
  EXPECT_GE(judged, 2u);
  for (const char* field : {"ssim", "psnr_db", "uncovered", "age_ms", "rest", "sampled"})
    EXPECT_EQ(display.at(field).size(), judged) << field;
  for (const auto& [name, value] : metrics) {
    EXPECT_FALSE(name.starts_with("display_") && std::isnan(value)) << name;
  }
  EXPECT_GT(value_of(metrics, "display_ssim_mean"), 0.7);
  EXPECT_LE(value_of(metrics, "display_ssim_mean"), 1.0);
  EXPECT_GE(value_of(metrics, "display_psnr_mean_db"), value_of(metrics, "display_psnr_p5_db"));
  EXPECT_THAT(to_table(run, {}), HasSubstr("| SSIM mean |"));
}

TEST(Load, BadOptionsAreToldBeforeAnythingRuns) {
  const auto refused = [](auto change) {
    LoadOptions options = small_load("ws://127.0.0.1:1");
    change(options);
    EXPECT_THROW(run_load(options), InputError);
  };
  refused([](LoadOptions& options) { options.url = "http://x"; });
  refused([](LoadOptions& options) { options.groups[0].sizes = {"big"}; });
  refused([](LoadOptions& options) { options.groups[0].script.script = "jump"; });
  refused([](LoadOptions& options) { options.groups[0].script.script = ""; });
  refused([](LoadOptions& options) { options.groups[0].traces = {"/nonexistent.tum"}; });
  refused([](LoadOptions& options) { options.duration_s = 0.0; });
  const test::TemporaryFolder folder;
  const std::filesystem::path trace = folder / "still.tum";
  write_tum(trace, {{0, Pose()}, {1'000'000, Pose()}});
  for (const double endless_s : {1e30, std::numeric_limits<double>::infinity()}) {
    refused([&](LoadOptions& options) {
      options.groups[0].script.script = "";
      options.groups[0].traces = {trace.string()};
      options.duration_s = endless_s;
    });
  }
  refused([](LoadOptions& options) { options.groups[0].ramp_s = 3.0; });
  refused([](LoadOptions& options) { options.groups[0].wishes.fov_y_deg = 0.0f; });
}

}  // namespace
}  // namespace catgs::load
