#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>

#include "render_core/thread_pool.h"
#include "server/schedule/frame_executor.h"

namespace catgs {

/// The CPU as a device: rendering and encoding share one pool. As many frames are under way as it
/// has threads, so work is parallel across sessions first; with fewer sessions the pool's idle
/// workers help inside a frame.
class PoolExecutor final : public FrameExecutor {
 public:
  explicit PoolExecutor(std::shared_ptr<ThreadPool> pool) : pool_(std::move(pool)) {}
  ~PoolExecutor() override;  // waits for streams that are closing

  [[nodiscard]] int slots() const override { return pool_->threads(); }
  void open(std::shared_ptr<Stream> stream, StreamSettings settings,
            std::function<void(StreamOpened)> done) override;
  void submit(FrameJob job, std::function<void(FrameResult)> done) override;
  void close(std::shared_ptr<Stream> stream) override;

 private:
  const std::shared_ptr<ThreadPool> pool_;
  std::mutex mutex_;
  std::condition_variable closed_;
  int closing_ = 0;
};

}  // namespace catgs
