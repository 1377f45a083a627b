#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include <libwebsockets.h>

namespace catgs {

/// A connection that another thread has work for.
class Wakeable {
 public:
  virtual ~Wakeable() = default;
  /// Network thread.
  virtual void service_woken() = 0;
};

/// Lets other threads reach the network thread. They list the connection that has work and wake the
/// poll loop. Waking is the only libwebsockets call allowed from outside.
class LwsWaker {
 public:
  void attach(lws_context* context);
  void detach();  // later calls of wake() do nothing
  void wake(std::shared_ptr<Wakeable> connection);
  void wake();
  std::vector<std::shared_ptr<Wakeable>> take();

 private:
  std::mutex mutex_;
  lws_context* context_ = nullptr;
  std::vector<std::shared_ptr<Wakeable>> pending_;
};

}  // namespace catgs
