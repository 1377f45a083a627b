// A session's frames: when one is due and of what, and what becomes of it.
#include <algorithm>
#include <utility>

#include "server/session/encoder_effort.h"
#include "server/session/same_view.h"
#include "server/session/session.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr int max_failures_in_a_row = 3;

// How soon one picture that stays may follow the other: once the link has carried it, and a quarter
// of that time later, so that what stands in line goes.
constexpr double still_pause = 1.25;
constexpr auto least_still_gap = 25ms;
constexpr double least_still_share = 0.3;  // where another queue stands in front of it
// JPEGs do not add up: each may be twice as large as the one before, down to a quarter of a second.
constexpr int last_jpeg_fps = 4;
constexpr int jpeg_refinements = 2;
// A still of less effort is no saving: of libx264's ultrafast 54 kB show what 37 of superfast do.
constexpr int least_still_preset = 2;
static_assert(effort_presets[least_still_preset].name == "superfast");
// More can hardly be seen, however much the link carries. A rendered city has 45 dB with 1.
constexpr double still_bits_per_pixel = 1.5;

}  // namespace

bool Session::view_has_changed() const {
  return !shown_ || !same_view(*shown_, track_.aim(), admission_.scene->facts.near_z);
}

std::optional<FrameCandidate> Session::next_frame() const {
  if (!streams() || rendering_ || !track_.newest() || !flow_.may_send()) return std::nullopt;
  const bool moved = view_has_changed();
  FrameCandidate frame{moved ? pace_.next_start_of_pose() : pace_.next_start(),
                       {},
                       cost_.next(),
                       cost_.key_is_next(),
                       device_};
  if (!moved) {
    // Between two poses of a moving camera a still would only be in the next one's way.
    const TimePoint rest = rest_.begins();
    const bool draws = wants_still();
    const bool refines = refinements_left_ > 0;
    if (idr_.wanted() && (!(draws || refines) || idr_.earliest() <= rest)) {
      frame.ready = std::max(frame.ready, idr_.earliest());
    } else if (draws || refines) {
      frame.ready = std::max({frame.ready, rest, next_refinement_});
      frame.key = draws;
      frame.cost = draws ? cost_.still() : cost_.refinement();
    } else {
      return std::nullopt;
    }
  }
  frame.ready = std::max(frame.ready, idr_.no_frame_before());
  frame.deadline = frame.ready + flow_.frame_interval();
  return frame;
}

/// A still of the same size needs no encoder of its own, and what sharpens it goes on in its
/// stream, however moving pictures are to be encoded by now.
EncoderSettings Session::encoding_at(bool rest) const {
  const glm::ivec2 size_px = still_size_px();
  if (rest && encoded_as_ && encoded_as_->size_px == size_px) return *encoded_as_;
  EncoderSettings encoding = encoding_;
  if (!rest || size_px == encoding.size_px) return encoding;
  EncoderEffort effort = admission_.effort;
  effort.preset = std::max(effort.preset, least_still_preset);
  apply(effort, encoding);
  encoding.size_px = size_px;
  encoding.fps = std::min(encoding.fps, still_fps);  // the VBV that its first picture finds filled
  return encoding;
}

FrameOrder Session::start_frame(TimePoint now) {
  rendering_ = true;
  FrameOrder order;
  FrameTicket& ticket = order.ticket;
  // By time alone: where credit was missing, the first picture of a pose may already be the still.
  ticket.still = now >= rest_.begins();
  order.encoding = encoding_at(ticket.still);
  if (encoded_as_ != order.encoding) idr_.begin();
  encoded_as_ = order.encoding;
  described_ = encoding_;
  order.force_idr = idr_.take(now);
  // What stays is a key frame of the pose itself: a sub-frame may lack a little at the edges of
  // tiles, and a forecast goes further than a camera that stops.
  ticket.refined = ticket.still && !order.force_idr && !view_has_changed() && !shown_is_passing_;
  if (ticket.still) track_.aim_at_newest();
  const PoseSample& aim = track_.aim();
  shown_is_passing_ = !same_view(aim, *track_.newest(), admission_.scene->facts.near_z);
  shown_ = aim;
  limit(order, now);

  ticket.frame_id = ++frames_started_;
  ticket.pose_id = aim.pose_id;
  ticket.pose_client_time_us = aim.client_time_us;
  ticket.render_pose = aim.world_from_camera;
  ticket.fov_y_rad = aim.fov_y_rad;
  ticket.size_px = order.encoding.size_px;
  ticket.pose_received = pose_received_;
  order.request.camera = make_camera(aim.world_from_camera, ticket.size_px,
                                     focal_from_fov_y(aim.fov_y_rad, ticket.size_px.y),
                                     admission_.scene->facts.near_z);
  if (!ticket.still)
    order.request.forecast = track_.forecast(order.real_fps, SpeculationSettings{}.initial_window);
  return order;
}

void Session::limit(FrameOrder& order, TimePoint now) {
  const bool h264 = config_.codec == Codec::h264;
  const int refinements = h264 ? policy_.refine_frames : jpeg_refinements;
  order.bitrate_kbps = flow_.bitrate_kbps();
  if (order.ticket.refined)
    --refinements_left_;
  else
    refinements_left_ = refinements;
  if (!order.ticket.still) {
    pace_.frame_starts(flow_.frame_interval(), now);
    flow_.set_real_interval(pace_.real_interval());
    order.real_fps = pace_.real_fps(encoding_.fps);
    return;
  }
  pace_.rests();
  const int done = refinements - refinements_left_;
  const int share_fps = h264 ? still_fps : std::max(still_fps >> done, last_jpeg_fps);
  order.real_fps = std::min(share_fps, order.encoding.fps);
  const std::chrono::microseconds interval(1'000'000 / order.real_fps);
  flow_.set_real_interval(interval);
  const TimePoint sent = now + (order.ticket.refined ? cost_.refinement() : cost_.still());
  const std::chrono::duration<double> in_line = flow_.standing(sent);
  const double share = std::max(least_still_share, 1.0 - in_line / interval);
  order.bitrate_kbps = static_cast<int>(share * flow_.still_bitrate_kbps(now));
  const glm::dvec2 size_px = order.encoding.size_px;
  const double enough_kbps = 1e-3 * still_bits_per_pixel * size_px.x * size_px.y * order.real_fps;
  order.bitrate_kbps =
      std::max(min_bitrate_kbps, std::min(order.bitrate_kbps, static_cast<int>(enough_kbps)));
}

void Session::on_frame(FrameResult result, TimePoint now) {
  rendering_ = false;
  if (state_ == State::closed) return;
  if (stream_outdated_) request_stream();
  if (!result.ok) return on_failed_frame(result);
  failures_ = 0;
  const FrameTicket& ticket = result.frame.ticket;
  if (ticket.frame_id <= obsolete_frames_) return;
  last_said_ = now;
  cost_.add(ticket);
  if (ticket.speculated) shown_is_passing_ = true;
  // The VBV follows the bitrate a picture late: the first at rest in the stream of motion had no
  // more room than motion, whatever was planned for it.
  const bool had_room =
      ticket.size_px != encoding_.size_px || refinements_left_ + 1 < policy_.refine_frames;
  if (result.sharp && had_room) refinements_left_ = 0;
  tell_config(result, now);
  const std::size_t bytes = result.frame.bitstream.size();
  if (ticket.still) {
    const std::chrono::duration<double> passing = flow_.time_on_link(bytes, now);
    next_refinement_ =
        now +
        std::max<Clock::duration>(
            least_still_gap, std::chrono::duration_cast<Clock::duration>(still_pause * passing));
  }
  flow_.sent({ticket.frame_id, bytes, ticket.size_px, ticket.still}, now);
  const auto dropped = host_.send(std::move(result.frame));
  for (const std::uint64_t id : dropped) flow_.lost(id);
  if (dropped.empty()) return;
  idr_.dropped(now);
  frames_dropped_ += dropped.size();
  stats_.dropped_packets += static_cast<std::uint32_t>(dropped.size());
}

void Session::on_failed_frame(const FrameResult& result) {
  shown_.reset();
  idr_.missed();
  const Fault fault = result.fault;
  const auto changes_encoder = [&] {
    auto other = host_.other_encoder(fault);
    if (!other) return false;
    admission_.encoder = *std::move(other);
    request_stream();
    return true;
  };
  // First: NVENC that fails makes way, whatever the frame.
  if (fault == Fault::encoder_failed && changes_encoder()) return;
  const bool of_larger_still =
      result.frame.ticket.still && encoded_as_ && encoded_as_->size_px != encoding_.size_px;
  if (of_larger_still && fault != Fault::device_failed) {
    stills_fail_ = true;  // no memory for so large a picture, no level of the encoder: as in motion
    return;
  }
  if (fault == Fault::encoder_unavailable) {
    if (changes_encoder()) return;
    return fail(ErrorCode::internal, "the stream cannot be opened: " + result.message);
  }
  if (++failures_ >= max_failures_in_a_row)
    return fail(ErrorCode::render_failed, "frames fail: " + result.message);
  if (fault == Fault::device_failed) request_stream();  // perhaps on another device
}

/// Before the first frame that it describes, which is an IDR.
void Session::tell_config(const FrameResult& result, TimePoint now) {
  if (!result.frame.ticket.idr) return;
  StreamConfig config = config_;
  config.size_px = result.frame.ticket.size_px;
  config.fps = described_.fps;
  config.bitrate_kbps = described_.bitrate_kbps;
  config.codec_string = result.codec_string;
  if (config == config_) return;
  config_ = config;
  say_config(now);
}

void Session::on_frame_sent(const FrameTicket& ticket, std::size_t bytes) {
  ++frames_sent_;
  bytes_sent_ += bytes;
  ++second_frames_;
  second_bytes_ += bytes;
  if (!ticket.refined) ++(ticket.speculated ? stats_.sub_frames : stats_.key_frames);
}

void Session::send_statistics(TimePoint now) {
  const float seconds = std::chrono::duration<float>(now - second_start_).count();
  second_start_ = now;
  if (second_frames_ == 0) return;  // the heartbeat speaks for a still picture
  stats_.fps = static_cast<float>(second_frames_) / seconds;
  stats_.bitrate_kbps = static_cast<float>(second_bytes_) * 8e-3f / seconds;
  stats_.sessions = host_.session_count();
  stats_.target_bitrate_kbps = flow_.bitrate_kbps();
  stats_.target_fps = static_cast<int>(1s / flow_.frame_interval());
  stats_.steps_down = static_cast<std::uint32_t>(flow_.steps_down());
  stats_.queue_delay_us = static_cast<std::uint32_t>(flow_.queue_delay().count());
  stats_.rtt_us = static_cast<std::uint32_t>(flow_.credit().base_rtt().count());
  say(stats_, now);
  stats_ = {};
  second_frames_ = 0;
  second_bytes_ = 0;
}

}  // namespace catgs
