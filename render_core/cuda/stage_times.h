#pragma once

#include <array>
#include <cstddef>

#include "render_core/cuda/stream.h"
#include "render_core/frame/renderer.h"

namespace catgs::cuda {

/// Times of a frame's stages on the device, from events between them.
class StageTimes {
 public:
  void begin(cudaStream_t stream) { record(start_, stream); }
  void end(Stage stage, cudaStream_t stream) { record(after_[index(stage)], stream); }
  /// Key frames bin in depth order, so the time before this belongs to Stage::sort.
  void end_depth_sort(cudaStream_t stream) { record(depth_sorted_, stream); }

  /// Times of a finished frame, [stage] in ms; all stages must have ended. Throws CudaError.
  void read(bool sorted_by_depth, std::array<float, stage_count>& stage_ms) const {
    const Event* before = &start_;
    for (std::size_t i = 0; i < stage_count; ++i) {
      stage_ms[i] = between(*before, after_[i]);
      before = &after_[i];
    }
    if (!sorted_by_depth) return;
    const float depth_sort_ms = between(after_[index(Stage::project)], depth_sorted_);
    stage_ms[index(Stage::bin)] -= depth_sort_ms;
    stage_ms[index(Stage::sort)] += depth_sort_ms;
  }

 private:
  static constexpr std::size_t index(Stage stage) { return static_cast<std::size_t>(stage); }
  static void record(const Event& event, cudaStream_t stream) {
    check(cudaEventRecord(event.get(), stream), "event");
  }
  static float between(const Event& from, const Event& to) {
    float ms = 0.0f;
    check(cudaEventElapsedTime(&ms, from.get(), to.get()), "stage time");
    return ms;
  }

  Event start_, depth_sorted_;
  std::array<Event, stage_count> after_;
};

}  // namespace catgs::cuda
