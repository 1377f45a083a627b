#include "server/graceful_stop.h"

#include <csignal>
#include <utility>

#include <unistd.h>

#include "server/base/log.h"
#include "server/config/config.h"
#include "server/net/net_server.h"
#include "server/scenes/sidecar_saver.h"
#include "server/visit/sessions.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto quick_stop_deadline = 1000ms;
constexpr auto farewell_time = 500ms;  // for close frames, after the deadline
constexpr auto drain_poll = 20ms;

}  // namespace

void GracefulStop::start(const Parts& parts) {
  parts_.emplace(parts);
  signals_.add(SIGINT);
  signals_.add(SIGTERM);
  while_loading_.reset();
  wait_for_signal();
}

void GracefulStop::begin_quickly() { begin(0ms, quick_stop_deadline); }

void GracefulStop::wait_for_signal() {
  signals_.async_wait([this](const boost::system::error_code& error, int signal) {
    if (error) return;
    if (begun_) ::_exit(1);
    wait_for_signal();
    if (signal == SIGTERM)
      begin(std::chrono::seconds(parts_->config.drain_wait_s),
            std::chrono::seconds(parts_->config.drain_deadline_s));
    else
      begin_quickly();
  });
}

void GracefulStop::begin(std::chrono::milliseconds wait, std::chrono::milliseconds deadline) {
  if (std::exchange(begun_, true)) return;
  parts_->ready = false;
  if (wait == 0ms) return drain(deadline);
  log_info({.event = "stopping"},
           "stopping: not ready any more, clients are asked to reconnect in {} s",
           std::chrono::duration_cast<std::chrono::seconds>(wait).count());
  timer_.expires_after(wait);
  timer_.async_wait([this, deadline](const boost::system::error_code&) { drain(deadline); });
}

void GracefulStop::give_up(const std::string& why) {
  if (begun_) return;
  failure_ = why;
  log_event(spdlog::level::critical, {.event = "failed"},
            "{}; the process ends, so that its supervisor restarts it", failure_);
  begin_quickly();
}

void GracefulStop::drain(std::chrono::milliseconds deadline) {
  log_info({.event = "drain"}, "stopping: {} connections are asked to reconnect",
           parts_->sessions.connections());
  parts_->sessions.drain(deadline);
  parts_->saver.stop();
  when_empty(Clock::now() + deadline, [this] {
    parts_->sessions.close_all();
    when_empty(Clock::now() + farewell_time, [this] { finish(); });
  });
}

void GracefulStop::when_empty(TimePoint deadline, std::function<void()> then) {
  const bool empty = parts_->sessions.connections() == 0 && parts_->net.uploads() == 0;
  if (empty || Clock::now() >= deadline) return then();
  timer_.expires_after(drain_poll);
  timer_.async_wait([this, deadline, then = std::move(then)](const boost::system::error_code&) {
    when_empty(deadline, then);
  });
}

void GracefulStop::finish() {
  parts_->net.stop();
  parts_->sessions.stop_timer();
  signals_.cancel();  // nothing is left to wait for but frames under way: io.run() returns
}

}  // namespace catgs
