#include "server/net/waker.h"

#include <utility>

namespace catgs {

void LwsWaker::attach(lws_context* context) {
  const std::lock_guard lock(mutex_);
  context_ = context;
}

void LwsWaker::detach() {
  const std::lock_guard lock(mutex_);
  context_ = nullptr;
  pending_.clear();
}

void LwsWaker::wake(std::shared_ptr<Wakeable> connection) {
  const std::lock_guard lock(mutex_);
  if (!context_) return;
  pending_.push_back(std::move(connection));
  if (pending_.size() == 1)
    lws_cancel_service(context_);  // otherwise a wake-up is already under way
}

void LwsWaker::wake() {
  const std::lock_guard lock(mutex_);
  if (context_) lws_cancel_service(context_);
}

std::vector<std::shared_ptr<Wakeable>> LwsWaker::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(pending_, {});
}

}  // namespace catgs
