#pragma once

#include <functional>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/prefer.hpp>

namespace catgs {

/// Returns a callback for an executor, which calls it on one of its threads. The callback runs
/// `handle(result)` on the session thread. The posted work is tracked: the session thread does not
/// end while an executor still owes an answer. `handle` moves on to the session thread, so that
/// what it holds never dies on a thread of the executor.
template <typename Result, typename Handle>
std::function<void(Result)> on_session_thread(boost::asio::io_context& io, Handle handle) {
  auto executor =
      boost::asio::prefer(io.get_executor(), boost::asio::execution::outstanding_work.tracked);
  return [executor, handle = std::move(handle)](Result result) mutable {
    boost::asio::post(executor, [handle = std::move(handle), result = std::move(result)]() mutable {
      handle(std::move(result));
    });
  };
}

}  // namespace catgs
