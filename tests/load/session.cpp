#include "tests/load/session.h"

#include <algorithm>
#include <random>

#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "tests/load/connection.h"

namespace catgs::load {

namespace {

/// Poses are numbered on, since the statistics find them by their numbers.
SessionState next_visitor(const SessionState& before) {
  SessionState state;
  state.next_pose_id = before.next_pose_id;
  return state;
}

}  // namespace

boost::asio::awaitable<void> run_session(SessionSettings settings, SessionContext context,
                                         SessionReport& report) {
  constexpr std::chrono::milliseconds first_pause{250}, longest_pause{4000};
  const auto executor = co_await boost::asio::this_coro::executor;
  std::minstd_rand jitter(static_cast<unsigned>(settings.offset * 1e6) + 1);
  SessionState state;
  std::chrono::milliseconds pause = first_pause;
  while (now_us() < settings.stop_us) {
    const std::uint64_t frames_before = report.stats.counts.frames;
    Connection connection(settings, context, state, report, executor);
    const Connection::End end = co_await connection.run();
    if (end == Connection::End::left) {  // the next visitor knows nothing of this one's session
      state = next_visitor(state);
      ++report.stats.counts.leaves;
      continue;
    }
    if (end != Connection::End::lost) break;
    report.stats.interrupted(now_us());
    if (report.stats.counts.frames > frames_before) pause = first_pause;
    // Half of the pause is jitter: a fleet of clients must not come back at once.
    const auto wait = pause / 2 + std::chrono::milliseconds(jitter() % (pause.count() / 2 + 1));
    pause = std::min(2 * pause, longest_pause);
    if (Clock::now() + wait >= clock_time(settings.stop_us)) break;
    boost::asio::steady_timer timer(executor, wait);
    co_await timer.async_wait(boost::asio::use_awaitable);
    ++report.stats.counts.reconnects;
  }
  report.stats.finished(now_us());
}

}  // namespace catgs::load
