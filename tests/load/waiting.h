#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "tests/load/clock.h"

namespace catgs::load {

/// Waits until `timer` is cancelled, which is how its event is signalled here.
inline boost::asio::awaitable<void> signal_of(boost::asio::steady_timer& timer) {
  boost::system::error_code cancelled;
  timer.expires_at(Clock::time_point::max());
  co_await timer.async_wait(boost::asio::redirect_error(boost::asio::use_awaitable, cancelled));
}

inline boost::asio::awaitable<void> wait_until(Clock::time_point time) {
  boost::asio::steady_timer timer(co_await boost::asio::this_coro::executor, time);
  co_await timer.async_wait(boost::asio::use_awaitable);
}

}  // namespace catgs::load
