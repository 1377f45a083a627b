#include "server/visit/frame_loop.h"

#include <algorithm>
#include <cassert>

#include "server/flow/same_view.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr int max_failures_in_a_row = 3;

// How far ahead a scene's pages are read: they take some tens of milliseconds.
constexpr auto pages_ahead = 150ms;

// The interval between refinements of a still: its time on the link, plus a quarter so that queues
// drain.
constexpr double still_pause = 1.25;
constexpr auto least_still_gap = 25ms;
constexpr double least_still_share = 0.3;  // where a queue is in front of it
// JPEGs do not refine each other. Each may be twice as large as the one before, down to a quarter
// of a second on the link.
constexpr int last_jpeg_fps = 4;
constexpr int jpeg_refinements = 2;
// A better picture can hardly be told apart, whatever the link carries. A rendered city reaches 45
// dB with 1.
constexpr double still_bits_per_pixel = 1.5;

}  // namespace

void FrameLoop::enter_scene(const SceneFacts& scene) {
  near_z_ = scene.near_z;
  background_ = colour_of(scene.about.background_rgb);
  clip_ = {};
  track_ = CameraTrack(near_z_);
  settled_ = true;
}

void FrameLoop::clip(const ClipBox& box, TimePoint now) {
  if (box == clip_) return;
  clip_ = box;
  shown_.reset();
  rest_.moved(now);
}

void FrameLoop::see_with(const std::optional<Stereo>& eyes, TimePoint now) {
  if (eyes == eyes_) return;
  eyes_ = eyes;
  shown_.reset();
  rest_.moved(now);
}

bool FrameLoop::pose_arrived(const PoseSample& sample, TimePoint now) {
  const auto before = track_.newest();
  // A picture drawn now is expected to be seen as long after its pose as recent pictures were.
  if (!track_.add(sample, policy_.forecasts ? flow_.pose_to_photon() : 0us)) {
    if (sample.at_rest && sample.pose_id == before->pose_id) rest_.said(now);
    return false;
  }
  pose_received_ = now;
  if (!flow_.may_send()) pace_.held_back(now);
  pace_.pose_arrived(flow_.frame_interval(), now);
  const bool moved = !before || !same_view(*before, sample, near_z_);
  if (moved) rest_.moved(now);
  if (sample.at_rest) rest_.said(now);  // it replaced the first pose with this id
  return moved;
}

void FrameLoop::go_on_from(const Hello& hello, TimePoint now) {
  if (hello.resume_pose) track_.begin_anew();  // a reloaded page restarts its numbering
  if (!hello.resume_path.samples.empty()) follow(hello.resume_path);
  if (hello.resume_pose) pose_arrived(*hello.resume_pose, now);
}

bool FrameLoop::acknowledged(const Ack& ack, TimePoint now) {
  if (!flow_.may_send()) pace_.held_back(now);
  return flow_.acknowledged(ack, now);
}

bool FrameLoop::shows(const PoseSample& pose) const {
  return shown_ && same_view(*shown_, pose, near_z_);
}

std::optional<FrameCandidate> FrameLoop::next(const IdrPolicy& idr, bool still_size) const {
  if (!track_.newest() || !flow_.may_send()) return std::nullopt;
  const bool moved = !settled_ || !shows(track_.aim());
  FrameCandidate frame{{}, {}, cost_.next()};
  std::optional<TimePoint> ready = moved ? pace_.next_start_of_pose() : pace_.next_start();
  if (!moved) {
    // Between two poses of a moving camera a still would only delay the next picture.
    const TimePoint rest = rest_.begins();
    // A forecast is not fit as a still, and neither is a picture of another size.
    const bool draws = !still_size || !shows(*track_.newest());
    const bool refines = refinements_left_ > 0;
    if (idr.wanted() && (!(draws || refines) || idr.earliest() <= rest)) {
      ready = std::max(ready, idr.earliest());
    } else if (draws || refines) {
      ready = std::max({ready, std::optional(rest), next_refinement_});
      frame.cost = draws ? cost_.still() : cost_.refinement();
    } else {
      return std::nullopt;
    }
  }
  frame.ready = std::max(ready, idr.no_frame_before()).value_or(*pose_received_);
  frame.deadline = frame.ready + flow_.frame_interval();
  return frame;
}

void FrameLoop::start(FrameOrder& order, TimePoint now) {
  assert(track_.newest());
  FrameTicket& ticket = order.ticket;
  // A still shows the pose itself. A forecast overshoots a camera that stops.
  ticket.refined =
      ticket.still && !order.force_idr && shows(track_.aim()) && shows(*track_.newest());
  if (ticket.still) track_.aim_at_newest();
  const PoseSample& aim = track_.aim();
  shown_ = aim;
  limit(order, now);

  ticket.frame_id = ++frames_started_;
  ticket.pose_id = aim.pose_id;
  ticket.pose_client_time_us = aim.client_time_us;
  ticket.render_pose = aim.world_from_camera;
  ticket.fov_y_rad = aim.fov_y_rad;
  ticket.view_height = aim.view_height;
  ticket.size_px = order.encoding.size_px;
  ticket.pose_received = *pose_received_;
  order.request.camera = make_view_camera(aim.world_from_camera, ticket.size_px, aim.fov_y_rad,
                                          aim.view_height, near_z_);
  order.request.camera.clip = clip_;
  if (aim.view_height == 0.0f) order.request.stereo = eyes_;
  ticket.stereo = order.request.stereo;
  order.request.background = background_;
  order.request.detail_px = ticket.still ? policy_.detail_px : detail_.detail_px();
  order.request.soon = track_.ahead(pages_ahead);
  // A still is drawn once, and exactly where the camera is. Sub-frames do not show pages that come.
  if (!ticket.still && settled_)
    order.request.forecast = track_.forecast(order.real_fps, following_speculation.initial_window);
}

void FrameLoop::limit(FrameOrder& order, TimePoint now) {
  const bool h264 = order.ticket.codec == Codec::h264;
  const int refinements = h264 ? policy_.refine_frames : jpeg_refinements;
  order.bitrate_kbps = flow_.bitrate_kbps();
  if (order.ticket.refined)
    --refinements_left_;
  else
    refinements_left_ = refinements;
  if (!order.ticket.still) {
    pace_.frame_starts(flow_.frame_interval(), now);
    flow_.set_real_interval(pace_.real_interval());
    order.real_fps = pace_.real_fps(order.encoding.fps);
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

bool FrameLoop::made(const FrameResult& result, TimePoint now) {
  failures_ = 0;
  const FrameTicket& ticket = result.frame.ticket;
  if (ticket.frame_id <= obsolete_frames_) return false;
  cost_.add(ticket);
  if (!ticket.refined) settled_ = result.stats.settled;
  if (!ticket.still) detail_.update(cost_.render(), interval(), now);
  if (result.sharp) refinements_left_ = 0;
  const std::size_t bytes = result.frame.bytes();
  if (ticket.still) {
    const std::chrono::duration<double> passing = flow_.time_on_link(bytes, now);
    next_refinement_ =
        now +
        std::max<Clock::duration>(
            least_still_gap, std::chrono::duration_cast<Clock::duration>(still_pause * passing));
  }
  flow_.sent({ticket.frame_id, bytes, ticket.size_px, ticket.still}, now);
  return true;
}

bool FrameLoop::failed_again() { return ++failures_ >= max_failures_in_a_row; }

}  // namespace catgs
