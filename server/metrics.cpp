#include "server/metrics.h"

#include <algorithm>
#include <iterator>

#include <prometheus/text_serializer.h>

#include "server/log.h"
#include "server/process_metrics.h"

namespace catgs {
namespace {

using prometheus::Counter;
using prometheus::Gauge;
using prometheus::Histogram;
using prometheus::Registry;

// From a tenth of a frame at 120 Hz to a frozen picture.
const Histogram::BucketBoundaries latency_buckets_s = {
    0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.033, 0.066, 0.1, 0.15, 0.25, 0.5, 1.0, 2.0};

Gauge& gauge(Registry& registry, const char* name, const char* help,
             const prometheus::Labels& labels = {}) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(registry).Add(labels);
}

Gauge& budget(Registry& registry, const char* resource) {
  return gauge(
      registry, "catgs_budget_used_ratio",
      "Share of processors and GPUs that the sessions take at --min-fps, as measured; at 1 "
      "admission ends",
      {{"resource", resource}});
}

Counter& counter(Registry& registry, const char* name, const char* help,
                 const prometheus::Labels& labels = {}) {
  return prometheus::BuildCounter().Name(name).Help(help).Register(registry).Add(labels);
}

Histogram& stage(Registry& registry, const char* name) {
  return prometheus::BuildHistogram()
      .Name("catgs_frame_stage_seconds")
      .Help(
          "Duration of a frame's stages: queue_wait (it could start, others' turns came first), "
          "hand_off (to the thread that renders), render_key, render_sub, encode_wait (to the "
          "thread "
          "that encodes), encode, send (encoded to handed to the socket)")
      .Register(registry)
      .Add({{"stage", name}}, latency_buckets_s);
}

Histogram& latency(Registry& registry, const char* name, const char* help) {
  return prometheus::BuildHistogram().Name(name).Help(help).Register(registry).Add(
      {}, latency_buckets_s);
}

double seconds(TimePoint from, TimePoint to) {
  return std::chrono::duration<double>(to - from).count();
}

}  // namespace

Metrics::Metrics()
    : views_(prometheus::BuildGauge()
                 .Name("catgs_device_views")
                 .Help("Streams that render on a CUDA device")
                 .Register(registry_)),
      loop_stalled_(prometheus::BuildGauge()
                        .Name("catgs_loop_stalled_seconds")
                        .Help("Since the session thread moved, and the age of the oldest frame "
                              "under way")
                        .Register(registry_)),
      encoder_sessions_(prometheus::BuildGauge()
                            .Name("catgs_encoder_sessions")
                            .Help("Sessions by their video encoder")
                            .Register(registry_)),
      connections(gauge(registry_, "catgs_connections", "Open websockets")),
      sessions(gauge(registry_, "catgs_sessions", "Admitted sessions")),
      sessions_lost(
          gauge(registry_, "catgs_sessions_lost", "Admitted sessions whose client may come back")),
      sessions_waiting(
          gauge(registry_, "catgs_sessions_waiting", "Clients in the queue for a place")),
      spectators(gauge(registry_, "catgs_spectators", "Clients that watch others' sessions")),
      seats(gauge(registry_, "catgs_seats",
                  "Sessions that there is room for, by --max-sessions and by what the present ones "
                  "take; taken ones included, 0 when draining")),
      cpu_budget_used(budget(registry_, "cpu")),
      gpu_budget_used(budget(registry_, "gpu")),
      scenes_in_memory(gauge(registry_, "catgs_scenes_in_memory", "Scenes in memory")),
      scene_bytes(gauge(registry_, "catgs_scene_bytes", "Memory of these scenes on each device")),
      frames_running(gauge(registry_, "catgs_frames_running", "Frames being rendered or encoded")),
      frames_queued(
          gauge(registry_, "catgs_frames_queued", "Encoded frames waiting for their sockets")),
      frames_in_flight(gauge(registry_, "catgs_frames_in_flight",
                             "Frames sent and neither presented nor dropped")),
      sessions_stepped_down(
          gauge(registry_, "catgs_sessions_stepped_down",
                "Sessions that get a smaller size or frame rate than they asked for")),
      target_bits_per_second(gauge(registry_, "catgs_target_bits_per_second",
                                   "What the links of all live sessions are held to be good for")),
      processors_busy(gauge(registry_, "catgs_processors_busy_ratio",
                            "Share of the processors' time that the server takes")),
      encoders_refused(
          counter(registry_, "catgs_encoders_refused_total",
                  "NVENC encoders that their driver did not open; those that were open and failed "
                  "are among catgs_frames_failed_total")),
      effort_changes(counter(registry_, "catgs_encoder_effort_changes_total",
                             "Changes of preset or threads of encoders in software")),
      sessions_admitted(counter(registry_, "catgs_sessions_admitted_total", "Sessions admitted")),
      sessions_refused(counter(registry_, "catgs_sessions_refused_total",
                               "Sessions refused or closed for an error")),
      requests_refused(counter(
          registry_, "catgs_requests_refused_total",
          "Requests, websockets and uploads refused for their Host, Origin, token or form, and "
          "connections beyond what descriptors there are; not what libwebsockets answers with 403 "
          "by itself, or hangs up on without an error")),
      sessions_resumed(
          counter(registry_, "catgs_sessions_resumed_total", "Sessions whose client came back")),
      scenes_loaded(counter(registry_, "catgs_scenes_loaded_total",
                            "Scenes loaded because somebody asked for them")),
      scene_loads_failed(
          counter(registry_, "catgs_scene_loads_failed_total", "Scenes that could not be loaded")),
      scenes_released(counter(registry_, "catgs_scenes_released_total",
                              "Scenes that left memory for others, or because their file changed")),
      frames_rendered(counter(registry_, "catgs_frames_rendered_total", "Frames rendered")),
      frames_refined(counter(registry_, "catgs_frames_refined_total",
                             "Frames that sharpened a still picture, not rendered again")),
      frames_sent(counter(registry_, "catgs_frames_sent_total", "Frames handed to their sockets")),
      frames_failed(counter(registry_, "catgs_frames_failed_total",
                            "Frames that failed in rendering or encoding")),
      streams_failed(counter(registry_, "catgs_streams_failed_total",
                             "Streams that could not be opened: a View or an encoder was refused")),
      frames_dropped_by_server(counter(registry_, "catgs_frames_dropped_total",
                                       "Frames dropped before they were shown",
                                       {{"by", "server"}})),
      frames_dropped_by_client(counter(registry_, "catgs_frames_dropped_total",
                                       "Frames dropped before they were shown",
                                       {{"by", "client"}})),
      bytes_sent(counter(registry_, "catgs_frame_bytes_sent_total", "Bytes of frame packets")),
      poses_received(counter(registry_, "catgs_poses_received_total", "Pose samples received")),
      poses_superseded(counter(registry_, "catgs_poses_superseded_total",
                               "Pose samples replaced by a newer one before they were used")),
      bad_messages(
          counter(registry_, "catgs_bad_messages_total", "Sessions that ended with BAD_MESSAGE")),
      list_entries_overflowed(counter(registry_, "catgs_list_entries_overflowed_total",
                                      "Tile list entries that found no memory")),
      queue_wait_seconds(stage(registry_, "queue_wait")),
      hand_off_seconds(stage(registry_, "hand_off")),
      render_key_seconds(stage(registry_, "render_key")),
      render_sub_seconds(stage(registry_, "render_sub")),
      encode_wait_seconds(stage(registry_, "encode_wait")),
      encode_seconds(stage(registry_, "encode")),
      send_seconds(stage(registry_, "send")),
      link_queue_seconds(latency(registry_, "catgs_link_queue_seconds",
                                 "What stands on the way to a client, four times a second")),
      pose_to_frame_seconds(latency(registry_, "catgs_pose_to_frame_seconds",
                                    "Pose received to its frame handed to the socket")),
      motion_to_photon_seconds(latency(registry_, "catgs_motion_to_photon_seconds",
                                       "Age of a frame's pose when the client showed it")) {}

std::string Metrics::scrape() const {
  auto families = registry_.Collect();
  std::ranges::move(process_metrics(), std::back_inserter(families));
  prometheus::ClientMetric lost;
  lost.counter.value = static_cast<double>(log_lines_lost());
  families.push_back({"catgs_log_lines_lost_total",
                      "Lines that are not in the log: there were too many, or standard error did "
                      "not take them (a full disk, a pipe that nobody reads)",
                      prometheus::MetricType::Counter,
                      {lost}});
  return prometheus::TextSerializer().Serialize(families);
}

void Metrics::set_views(int device, int views) {
  views_.Add({{"device", std::to_string(device)}}).Set(views);  // the gauge that is there already
}

void Metrics::set_loop_stalled(const std::string& loop, Clock::duration stalled) {
  loop_stalled_.Add({{"loop", loop}}).Set(std::chrono::duration<double>(stalled).count());
}

void Metrics::set_encoder_sessions(const std::string& encoder, int count) {
  encoder_sessions_.Add({{"encoder", encoder}}).Set(count);
}

void Metrics::observe_frame(const FrameTicket& ticket, TimePoint now) {
  encode_wait_seconds.Observe(seconds(ticket.render->end, ticket.encode->start));
  encode_seconds.Observe(seconds(ticket.encode->start, ticket.encode->end));
  send_seconds.Observe(seconds(ticket.encode->end, now));
  if (ticket.still) return;  // late on purpose, of another size perhaps
  queue_wait_seconds.Observe(seconds(ticket.ready, ticket.started));
  hand_off_seconds.Observe(seconds(ticket.started, ticket.render->start));
  (ticket.speculated ? render_sub_seconds : render_key_seconds)
      .Observe(seconds(ticket.render->start, ticket.render->end));
  pose_to_frame_seconds.Observe(seconds(ticket.pose_received, now));
}

}  // namespace catgs
