#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>

#include "render_core/thread_pool.h"
#include "server/schedule/frame_executor.h"

namespace catgs {

/// Threads that render and encode. As many frames are under way as there are threads.
/// - The CPU core renders and encodes in one pool: work is parallel across sessions first; with
///   fewer sessions the pool's idle workers help inside a frame.
/// - Where GPUs render, threads that render wait for them most of the time. They are a pool of
///   their own, a few for each GPU, so that none of those that encode, one for each processor, ever
///   waits. A frame goes from one to the other.
class PoolExecutor final : public FrameExecutor {
 public:
  struct Pools {
    std::shared_ptr<ThreadPool> encode;
    std::shared_ptr<ThreadPool>
        render;  // may be the same; ends first, since it hands on to the other
  };
  explicit PoolExecutor(const std::shared_ptr<ThreadPool>& pool) : PoolExecutor({pool, pool}) {}
  explicit PoolExecutor(Pools pools, EncoderFactory encoders = make_encoder);
  ~PoolExecutor() override;  // waits for streams that are closing

  [[nodiscard]] int slots() const override;
  void open(std::shared_ptr<Stream> stream, StreamSettings settings,
            std::function<void(StreamOpened)> done) override;
  void submit(FrameJob job, std::function<void(FrameResult)> done) override;
  void close(std::shared_ptr<Stream> stream) override;

 private:
  const Pools pools_;
  const EncoderFactory encoders_;
  std::mutex mutex_;
  std::condition_variable closed_;
  int closing_ = 0;
};

}  // namespace catgs
