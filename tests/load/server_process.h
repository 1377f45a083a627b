#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>
#include <sys/types.h>

#include "tests/load/metrics.h"

namespace catgs::load {

/// The load of the machine in a span, as shares of all its cores.
struct UsageSample {
  double at_s = 0.0;  // since the first sample
  double server_cpu = 0.0, generator_cpu = 0.0, machine_cpu = 0.0;
  double server_rss_mb = 0.0;
};

/// A catgs-server that a run starts for itself, on ports of the system's choice, and watches.
class ServerProcess {
 public:
  /// Starts `command` with `--port 0 --admin-bind 127.0.0.1:0` and waits until it serves. Its log
  /// goes to `log`. Throws InputError with the end of that when it ends first.
  ServerProcess(std::vector<std::string> command, std::filesystem::path log);
  ~ServerProcess();

  [[nodiscard]] const std::string& url() const { return url_; }
  void signal(int number) const;
  /// From here on usage and counters are measured.
  void begin_measuring();
  void end_measuring();
  /// SIGTERM, and SIGKILL when it has not ended ten seconds later.
  void stop();

  /// "server.cpu_percent", "server.rss_growth_mb", "machine.others_cpu_percent", and the change of
  /// everything under /api/metrics: "server.frame_stage_send_p99_ms", "server.frames_sent_total".
  /// NaN before end_measuring().
  [[nodiscard]] Metrics metrics() const;
  [[nodiscard]] const std::vector<UsageSample>& usage() const { return usage_; }

 private:
  void wait_until_serving();
  void sample(const std::stop_token& stop);
  [[nodiscard]] nlohmann::ordered_json server_metrics() const;
  [[nodiscard]] std::string log_text() const;

  std::filesystem::path log_;
  pid_t pid_ = -1;
  int exit_code_ = -1;
  std::string url_;
  int admin_port_ = 0;
  std::jthread sampler_;
  std::vector<UsageSample> usage_;
  nlohmann::ordered_json before_, after_;  // answers of /api/metrics
};

}  // namespace catgs::load
