#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <prometheus/counter.h>
#include <prometheus/family.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include "server/base/clock.h"
#include "server/base/page_metrics.h"

namespace catgs {

/// The server's metrics for Prometheus. No label names a session, so the number of series does not
/// grow with visitors. Thread-safe.
class Metrics {
 public:
  Metrics();
  Metrics(const Metrics&) = delete;
  Metrics& operator=(const Metrics&) = delete;

  /// Returns a scrape in text format: our metrics and the standard process metrics.
  [[nodiscard]] std::string scrape() const;
  /// The same as JSON: series by family, each with its labels and a value, or the sum and the
  /// cumulative buckets of a histogram.
  [[nodiscard]] std::string json() const;

  /// Sets the current number of Views on a CUDA device.
  void set_views(int device, int views);
  /// Sets the present pages of all scenes in pages.
  void set_pages(std::vector<ScenePages> pages);
  /// Sets for how long a loop has not moved.
  void set_loop_stalled(const std::string& loop, Clock::duration stalled);
  /// Sets the current number of sessions with an encoder of this name.
  void set_encoder_sessions(const std::string& encoder, int count);

 private:
  [[nodiscard]] std::vector<prometheus::MetricFamily> families() const;
  prometheus::Gauge& gauge(const char* name, const char* help,
                           const prometheus::Labels& labels = {});
  prometheus::Counter& counter(const char* name, const char* help,
                               const prometheus::Labels& labels = {});
  prometheus::Gauge& budget(const char* resource);
  prometheus::Histogram& stage(const char* name);
  prometheus::Histogram& latency(const char* name, const char* help);

  mutable std::mutex pages_mutex_;
  std::vector<ScenePages> pages_;
  prometheus::Registry registry_;
  prometheus::Family<prometheus::Gauge>& views_ = prometheus::BuildGauge()
                                                      .Name("catgs_device_views")
                                                      .Help("Streams that render on a CUDA device")
                                                      .Register(registry_);
  prometheus::Family<prometheus::Gauge>& loop_stalled_ =
      prometheus::BuildGauge()
          .Name("catgs_loop_stalled_seconds")
          .Help(
              "Since the session thread moved, and the age of the oldest frame "
              "under way")
          .Register(registry_);
  prometheus::Family<prometheus::Gauge>& encoder_sessions_ =
      prometheus::BuildGauge()
          .Name("catgs_encoder_sessions")
          .Help("Sessions by their video encoder")
          .Register(registry_);

 public:
  prometheus::Gauge& connections = gauge("catgs_connections", "Open websockets");
  prometheus::Gauge& sessions = gauge("catgs_sessions", "Admitted sessions");
  prometheus::Gauge& sessions_lost =
      gauge("catgs_sessions_lost", "Admitted sessions whose client may come back");
  prometheus::Gauge& sessions_waiting =
      gauge("catgs_sessions_waiting", "Clients in the queue for a place");
  prometheus::Gauge& spectators = gauge("catgs_spectators", "Clients that watch others' sessions");
  prometheus::Gauge& seats = gauge(
      "catgs_seats",
      "Sessions that there is room for, by --max-sessions and by what the present ones take; taken "
      "ones included, 0 when draining");
  prometheus::Gauge& cpu_budget_used = budget("cpu");
  prometheus::Gauge& gpu_budget_used = budget("gpu");
  prometheus::Gauge& scenes_in_memory = gauge("catgs_scenes_in_memory", "Scenes in memory");
  prometheus::Gauge& scene_bytes =
      gauge("catgs_scene_bytes", "Memory of these scenes on each device");
  prometheus::Gauge& frames_running =
      gauge("catgs_frames_running", "Frames being rendered or encoded");
  prometheus::Gauge& frames_queued =
      gauge("catgs_frames_queued", "Encoded frames waiting for their sockets");
  prometheus::Gauge& frames_in_flight =
      gauge("catgs_frames_in_flight", "Frames sent and neither presented nor dropped");
  prometheus::Gauge& sessions_stepped_down =
      gauge("catgs_sessions_stepped_down",
            "Sessions that get a smaller size or frame rate than they asked for");
  prometheus::Gauge& target_bits_per_second =
      gauge("catgs_target_bits_per_second",
            "What the links of all live sessions are held to be good for");
  prometheus::Gauge& processors = gauge(
      "catgs_processors", "Processors that the server may use, of which a CPU quota is a part");
  prometheus::Gauge& processors_busy =
      gauge("catgs_processors_busy_ratio", "Share of the processors' time that the server takes");
  prometheus::Counter& encoders_refused =
      counter("catgs_encoders_refused_total",
              "NVENC encoders that their driver did not open; those that were open and failed are "
              "among catgs_frames_failed_total");
  prometheus::Counter& effort_changes = counter(
      "catgs_encoder_effort_changes_total", "Changes of preset or threads of encoders in software");
  prometheus::Counter& sessions_admitted =
      counter("catgs_sessions_admitted_total", "Sessions admitted");
  prometheus::Counter& sessions_refused =
      counter("catgs_sessions_refused_total", "Sessions refused or closed for an error");
  prometheus::Counter& requests_refused =
      counter("catgs_requests_refused_total",
              "Requests, websockets and uploads refused for their Host, Origin, token or form, and "
              "connections beyond what descriptors there are; not what libwebsockets answers with "
              "403 by itself, or hangs up on without an error");
  prometheus::Counter& uploads_refused = counter(
      "catgs_uploads_refused_total", "Saves of authors that found all places for uploads taken");
  prometheus::Counter& sessions_resumed =
      counter("catgs_sessions_resumed_total", "Sessions whose client came back");
  prometheus::Counter& scenes_loaded =
      counter("catgs_scenes_loaded_total", "Scenes loaded because somebody asked for them");
  prometheus::Counter& scene_loads_failed =
      counter("catgs_scene_loads_failed_total", "Scenes that could not be loaded");
  prometheus::Counter& scenes_released =
      counter("catgs_scenes_released_total",
              "Scenes that left memory for others, or because their file changed");
  prometheus::Gauge& tree_progress =
      gauge("catgs_tree_build_progress_ratio",
            "How much of a scene's tree is built, of the one that is being built; 0: none");
  prometheus::Counter& trees_built =
      counter("catgs_trees_built_total", "Trees of scenes built into --cache-dir");
  prometheus::Counter& tree_builds_failed =
      counter("catgs_tree_builds_failed_total", "Trees of scenes that could not be built");
  prometheus::Counter& frames_rendered = counter("catgs_frames_rendered_total", "Frames rendered");
  prometheus::Counter& device_seconds =
      counter("catgs_device_seconds_total", "Time that GPUs took for the frames rendered");
  prometheus::Counter& frames_speculated =
      counter("catgs_frames_speculated_total", "Frames drawn from the lists of an earlier one");
  prometheus::Counter& windows_cut = counter(
      "catgs_windows_cut_total", "Windows of such frames that ended before their forecast did");
  prometheus::Counter& frames_refined = counter(
      "catgs_frames_refined_total", "Frames that sharpened a still picture, not rendered again");
  prometheus::Counter& frames_sent =
      counter("catgs_frames_sent_total", "Frames handed to their sockets");
  prometheus::Counter& frames_failed =
      counter("catgs_frames_failed_total", "Frames that failed in rendering or encoding");
  prometheus::Counter& streams_failed =
      counter("catgs_streams_failed_total",
              "Streams that could not be opened: a View or an encoder was refused");
  prometheus::Counter& frames_dropped_by_server = counter(
      "catgs_frames_dropped_total", "Frames dropped before they were shown", {{"by", "server"}});
  prometheus::Counter& frames_dropped_by_client = counter(
      "catgs_frames_dropped_total", "Frames dropped before they were shown", {{"by", "client"}});
  prometheus::Counter& bytes_sent =
      counter("catgs_frame_bytes_sent_total", "Bytes of frame packets");
  prometheus::Counter& poses_received =
      counter("catgs_poses_received_total", "Pose samples received");
  prometheus::Counter& poses_superseded = counter(
      "catgs_poses_superseded_total", "Pose samples replaced by a newer one before they were used");
  prometheus::Counter& bad_messages =
      counter("catgs_bad_messages_total", "Sessions that ended with BAD_MESSAGE");
  prometheus::Counter& list_entries_overflowed =
      counter("catgs_list_entries_overflowed_total", "Tile list entries that found no memory");
  prometheus::Histogram& queue_wait_seconds = stage("queue_wait");
  prometheus::Histogram& hand_off_seconds = stage("hand_off");
  prometheus::Histogram& render_seconds = stage("render");
  prometheus::Histogram& encode_wait_seconds = stage("encode_wait");
  prometheus::Histogram& encode_seconds = stage("encode");
  prometheus::Histogram& send_seconds = stage("send");
  prometheus::Histogram& link_queue_seconds = latency(
      "catgs_link_queue_seconds", "What stands on the way to a client, four times a second");
  prometheus::Histogram& pose_to_frame_seconds =
      latency("catgs_pose_to_frame_seconds", "Pose received to its frame handed to the socket");
  prometheus::Histogram& motion_to_photon_seconds =
      latency("catgs_motion_to_photon_seconds", "Age of a frame's pose when the client showed it");
};

}  // namespace catgs
