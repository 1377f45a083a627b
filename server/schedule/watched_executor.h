#pragma once

#include <utility>

#include "server/base/liveness.h"
#include "server/schedule/frame_executor.h"

namespace catgs {

/// Wraps another executor and reports how long its frames and streams have been under way.
class WatchedExecutor final : public FrameExecutor {
 public:
  WatchedExecutor(std::shared_ptr<FrameExecutor> executor, Liveness& liveness)
      : executor_(std::move(executor)), liveness_(liveness) {}

  [[nodiscard]] int slots() const override { return executor_->slots(); }
  void open(std::shared_ptr<Stream> stream, StreamSettings settings,
            std::function<void(StreamOpened)> done) override {
    executor_->open(std::move(stream), std::move(settings), watched(std::move(done)));
  }
  void submit(FrameJob job, std::function<void(FrameResult)> done) override {
    executor_->submit(std::move(job), watched(std::move(done)));
  }
  void close(std::shared_ptr<Stream> stream) override { executor_->close(std::move(stream)); }

 private:
  template <typename Result>
  std::function<void(Result)> watched(std::function<void(Result)> done) {
    return [done = std::move(done), frame = liveness_.frame_started()](Result result) mutable {
      frame.reset();
      done(std::move(result));
    };
  }

  const std::shared_ptr<FrameExecutor> executor_;
  Liveness& liveness_;
};

}  // namespace catgs
