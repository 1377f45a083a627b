#pragma once

#include <chrono>
#include <memory>
#include <string>

#include <prometheus/counter.h>
#include <prometheus/family.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// What the server counts, for Prometheus. No label names a session, so their number does not grow
/// with the visitors. Every member may be used from any thread.
class Metrics {
 public:
  Metrics();

  /// The text format of a scrape: ours, and the process's as every exporter names them.
  [[nodiscard]] std::string scrape() const;

  /// Views that live on a CUDA device, as of now.
  void set_views(int device, int views);
  /// How long a loop has not moved, as of now.
  void set_loop_stalled(const std::string& loop, Clock::duration stalled);
  /// Sessions that have an encoder of this name, as of now.
  void set_encoder_sessions(const std::string& encoder, int count);

  /// Stage durations of a frame that was handed to the socket at `now`.
  void observe_frame(const FrameTicket& ticket, TimePoint now);

 private:
  prometheus::Registry registry_;
  prometheus::Family<prometheus::Gauge>& views_;
  prometheus::Family<prometheus::Gauge>& loop_stalled_;
  prometheus::Family<prometheus::Gauge>& encoder_sessions_;

 public:
  prometheus::Gauge& connections;
  prometheus::Gauge& sessions;
  prometheus::Gauge& sessions_lost;     // admitted, waiting for their clients to come back
  prometheus::Gauge& sessions_waiting;  // for a place
  prometheus::Gauge& spectators;
  prometheus::Gauge& seats;            // sessions that there is room for, taken ones included
  prometheus::Gauge& cpu_budget_used;  // at --min-fps for everybody; 1: admission ends
  prometheus::Gauge& gpu_budget_used;
  prometheus::Gauge& scenes_in_memory;
  prometheus::Gauge& scene_bytes;     // of those, on each device
  prometheus::Gauge& frames_running;  // being rendered or encoded
  prometheus::Gauge& frames_queued;   // encoded, waiting for their sockets
  prometheus::Gauge& frames_in_flight;
  prometheus::Gauge& sessions_stepped_down;   // get less than they asked for: size or frame rate
  prometheus::Gauge& target_bits_per_second;  // of all sessions
  prometheus::Gauge& processors_busy;         // share of their time, lately
  prometheus::Counter& encoders_refused;      // by a driver, when they were opened
  prometheus::Counter& effort_changes;        // of software encoders
  prometheus::Counter& sessions_admitted;
  prometheus::Counter& sessions_refused;
  prometheus::Counter& requests_refused;  // before there was a session
  prometheus::Counter& sessions_resumed;
  prometheus::Counter& scenes_loaded;  // when somebody asked for them
  prometheus::Counter& scene_loads_failed;
  prometheus::Counter& scenes_released;
  prometheus::Counter& frames_rendered;
  prometheus::Counter& frames_refined;
  prometheus::Counter& frames_sent;
  prometheus::Counter& frames_failed;
  prometheus::Counter& streams_failed;            // could not be opened
  prometheus::Counter& frames_dropped_by_server;  // overflow of a packet ring
  prometheus::Counter& frames_dropped_by_client;
  prometheus::Counter& bytes_sent;
  prometheus::Counter& poses_received;
  prometheus::Counter& poses_superseded;  // replaced by a newer one before they were looked at
  prometheus::Counter& bad_messages;
  prometheus::Counter& list_entries_overflowed;
  prometheus::Histogram& queue_wait_seconds;
  prometheus::Histogram& hand_off_seconds;
  prometheus::Histogram& render_key_seconds;
  prometheus::Histogram& render_sub_seconds;
  prometheus::Histogram& encode_wait_seconds;
  prometheus::Histogram& encode_seconds;
  prometheus::Histogram& send_seconds;
  prometheus::Histogram& link_queue_seconds;  // of each live session, four times a second
  prometheus::Histogram& pose_to_frame_seconds;
  prometheus::Histogram& motion_to_photon_seconds;  // on the client's clock
};

}  // namespace catgs
