#include "server/visit/visit_statistics.h"

#include <chrono>
#include <utility>

namespace catgs {

using namespace std::chrono_literals;

void VisitStatistics::frame_sent(std::size_t bytes) {
  ++frames_sent_;
  bytes_sent_ += bytes;
  ++second_frames_;
  second_bytes_ += bytes;
}

void VisitStatistics::frame_drawn(const FrameStats& frame, double device_s) {
  ++second_drawn_;
  if (frame.kind == FrameKind::key) ++second_keys_;
  if (frame.cut_window) ++stats_.windows_cut;
  second_device_s_ += device_s;
}

void VisitStatistics::pages_drawn(const FrameStats& frame, float detail_px) {
  stats_.gaussians_drawn = frame.visible;
  stats_.nodes_drawn = frame.nodes;
  stats_.missing_pages = frame.missing_pages;
  stats_.coarsest_px = frame.coarsest_px;
  stats_.detail_px = detail_px;
  stats_.finest_level = frame.finest_level;
  stats_.coarsest_level = frame.coarsest_level;
}

void VisitStatistics::frames_lost(std::size_t count) {
  frames_dropped_ += count;
  stats_.dropped_packets += static_cast<std::uint32_t>(count);
}

std::optional<Stats> VisitStatistics::take(const FlowControl& flow, int sessions, TimePoint now) {
  if (now - second_start_ < 1s) return std::nullopt;
  const float seconds = std::chrono::duration<float>(now - second_start_).count();
  second_start_ = now;
  if (second_frames_ == 0) return std::nullopt;  // a still picture has the heartbeat instead
  const auto drawn = static_cast<float>(std::exchange(second_drawn_, 0));
  const auto keys = static_cast<float>(std::exchange(second_keys_, 0));
  const auto device_ms = static_cast<float>(1e3 * std::exchange(second_device_s_, 0.0));
  Stats stats = std::exchange(stats_, {});
  stats.fps = static_cast<float>(std::exchange(second_frames_, 0)) / seconds;
  stats.bitrate_kbps = static_cast<float>(std::exchange(second_bytes_, 0)) * 8e-3f / seconds;
  if (drawn > 0.0f) stats.device_ms = device_ms / drawn;
  if (keys > 0.0f) stats.frames_per_key = drawn / keys;
  stats.sessions = static_cast<std::uint32_t>(sessions);
  stats.target_bitrate_kbps = flow.bitrate_kbps();
  stats.target_fps = static_cast<int>(1s / flow.frame_interval());
  stats.steps_down = static_cast<std::uint32_t>(flow.ladder().steps_down());
  stats.queue_delay_us = static_cast<std::uint32_t>(flow.queue_delay().count());
  stats.rtt_us = static_cast<std::uint32_t>(flow.credit().base_rtt().count());
  return stats;
}

}  // namespace catgs
