#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>

#include "render_core/base/thread_pool.h"
#include "server/schedule/frame_executor.h"

namespace catgs {

/// Threads that render and encode. As many frames are under way as there are threads.
/// - The CPU core renders and encodes in one pool: work is parallel across sessions first; with
///   fewer sessions the pool's idle workers help inside a frame.
/// - Where GPUs render, threads that render wait for them most of the time. Each GPU has a few, a
///   pool of their own, so that no GPU waits for frames of another, and none of those that encode,
///   one for each processor, ever waits. A frame goes from one to the other.
class PoolExecutor final : public FrameExecutor {
 public:
  struct Pools {
    std::shared_ptr<ThreadPool> encode;
    // By the device of a View; none: what encodes renders. They end first, since they hand on.
    std::map<int, std::shared_ptr<ThreadPool>> render{};
  };
  explicit PoolExecutor(const std::shared_ptr<ThreadPool>& pool) : PoolExecutor(Pools{pool}) {}
  explicit PoolExecutor(Pools pools, EncoderFactory encoders = make_encoder);
  ~PoolExecutor() override;  // waits for streams that are closing

  [[nodiscard]] int slots() const override;
  void open(std::shared_ptr<Stream> stream, StreamSettings settings,
            std::function<void(StreamOpened)> done) override;
  void submit(FrameJob job, std::function<void(FrameResult)> done) override;
  void close(std::shared_ptr<Stream> stream) override;

 private:
  [[nodiscard]] ThreadPool* render_pool(const View& view) const;

  const Pools pools_;
  const EncoderFactory encoders_;
  std::mutex mutex_;
  std::condition_variable closed_;
  int closing_ = 0;
};

}  // namespace catgs
