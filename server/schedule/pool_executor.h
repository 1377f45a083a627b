#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>

#include "render_core/base/thread_pool.h"
#include "server/schedule/frame_executor.h"

namespace catgs {

/// Renders and encodes on thread pools. As many frames are under way as there are threads.
/// - CPU core: one pool renders and encodes. Work is parallel across sessions first; with fewer
///   sessions, idle workers help inside a frame.
/// - GPUs: render threads mostly wait for their GPU. Each GPU has a small pool of its own, so that
///   none waits for another's frames. A separate pool encodes, with one thread for each processor,
///   and never waits for a GPU. Each frame moves from the first pool to the second.
class PoolExecutor final : public FrameExecutor {
 public:
  struct Pools {
    std::shared_ptr<ThreadPool> encode;
    // Render pools by a View's device; empty: the encoding pool renders. They are destroyed first,
    // because they hand frames on.
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
