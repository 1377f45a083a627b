#include "server/flow/flow_control.h"

#include <algorithm>

namespace catgs {
namespace {

using std::chrono::microseconds;
using namespace std::chrono_literals;

// The start rate is one that most links carry. A higher request has to be proved.
constexpr double start_bits_per_s = 10e6;
constexpr double most_pixels_per_s = 8192.0 * 4320.0 * max_encoded_fps;
constexpr double least_pixels_per_s = 160.0 * 90.0 * 5.0;

// The target delay is a frame interval, see RateController. More than two intervals at 60 Hz are
// not interactive, however slow the session is.
constexpr microseconds least_target = 10ms;
constexpr microseconds most_target = 33ms;

// A decoder is paced no slower than this, because it is only measured by the frames that it gets.
constexpr double least_paced_fps = 2.0;

constexpr auto rest = 1s;  // without a frame
constexpr double unused_share = 0.5;
constexpr auto link_state_holds = 100ms;
constexpr double most_horizon_us = 100'000.0;
constexpr double horizon_smoothing = 1.0 / 16.0;  // frames: a quarter of a second at 60 fps

microseconds interval_of(double fps) { return microseconds(static_cast<int>(1e6 / fps)); }

std::int64_t server_us(TimePoint time) {
  return std::chrono::duration_cast<microseconds>(time.time_since_epoch()).count();
}

RateController::Limits network_limits(const FlowRequest& request) {
  const double most = 1e3 * request.bitrate_kbps;
  return {1e3 * min_bitrate_kbps, most, std::min(most, start_bits_per_s)};
}

}  // namespace

FlowControl::FlowControl()
    : credit_(interval_of(request_.fps)),
      network_(network_limits(request_)),
      decoder_({least_pixels_per_s, most_pixels_per_s, most_pixels_per_s}) {}

void FlowControl::set_request(const FlowRequest& request) {
  if (request == request_) return;
  if (request.size_px != request_.size_px || request.fps != request_.fps)
    ladder_ = QualityLadder(request.size_px, request.fps);
  if (credit_.base_rtt() == 0us)  // the link is not measured yet
    network_ = RateController(network_limits(request));
  else
    network_.set_limits(network_limits(request));
  if (request.fixed_quality) credit_.set_link_rate(std::nullopt);
  request_ = request;
  frame_size_px_ = request.size_px;
  apply_interval();
}

void FlowControl::sent(const SentFrame& frame, TimePoint now) {
  if (last_sent_ && now - *last_sent_ > rest) ladder_.rested(now);
  last_sent_ = now;
  if (!frame.still) frame_size_px_ = frame.size_px;
  const auto pixels = frame.still ? 0 : static_cast<std::size_t>(frame.size_px.x) * frame.size_px.y;
  credit_.sent({frame.frame_id, frame.bytes, pixels, now, frame.still});
  carried_by_ = std::max(carried_by_.value_or(now), now) + time_on_link(frame.bytes, now);
}

bool FlowControl::acknowledged(const Ack& ack, TimePoint now) {
  const auto settled = credit_.acknowledged(ack.frame_id, ack.dropped, now);
  if (!settled) return false;
  observe_network(ack, *settled, now);
  observe_decoder(ack, *settled, now);
  if (ack.presented_us > 0) {
    const double age_us = std::min(static_cast<double>(ack.pose_age_us), most_horizon_us);
    if (pose_to_photon_us_ == 0.0) pose_to_photon_us_ = age_us;
    pose_to_photon_us_ += horizon_smoothing * (age_us - pose_to_photon_us_);
  }
  // The rest has passed, even if the link's rate was underestimated.
  carried_by_ = std::min(*carried_by_, now + time_on_link(credit_.bytes_in_flight(), now));
  if (!request_.fixed_quality) credit_.set_link_rate(network_.rate());
  return true;
}

void FlowControl::observe_network(const Ack& ack, const CreditWindow::Settled& settled,
                                  TimePoint now) {
  // The client gave the frame up before its turn without an arrival time. That tells nothing about
  // the path.
  if (ack.received_us <= 0 && ack.dropped) return;
  RateController::Sample sample;
  // Use the one-way delay if the client reports the arrival. Use the round trip too, unless the
  // client gave the frame up before its turn.
  if (ack.received_us > 0) sample.delays_us[0] = ack.received_us - server_us(settled.frame.sent);
  if (!ack.dropped) sample.delays_us[1] = settled.round_trip.count();
  sample.finished_us = ack.received_us > 0 ? ack.received_us : server_us(now);
  sample.units = 8.0 * static_cast<double>(settled.bytes);
  sample.round_trip = settled.round_trip;
  // Treat it as a frame that takes one interval on a full link.
  if (settled.frame.still)
    sample.own = time_on_link(settled.frame.bytes, now) - network_.target_delay();
  network_.add(sample, now);
}

void FlowControl::observe_decoder(const Ack& ack, const CreditWindow::Settled& settled,
                                  TimePoint now) {
  if (settled.frame.pixels == 0) return;
  if (ack.received_us <= 0 || ack.decoded_us < ack.received_us) return;
  RateController::Sample sample;
  sample.delays_us[0] = ack.decoded_us - ack.received_us;
  sample.finished_us = ack.decoded_us;
  sample.units = static_cast<double>(settled.pixels);
  sample.round_trip = settled.round_trip;
  decoder_.add(sample, now);
  apply_interval();
}

void FlowControl::observed(const LinkState& link, TimePoint now) {
  link_ = link;
  link_seen_ = now;
}

void FlowControl::set_real_interval(microseconds interval) {
  real_interval_ = interval;
  apply_interval();
}

void FlowControl::apply_interval() {
  credit_.set_frame_interval(frame_interval());
  const microseconds interval = std::max(frame_interval(), real_interval_);
  const microseconds target = std::clamp(interval, least_target, most_target);
  network_.set_target_delay(target);
  decoder_.set_target_delay(target);
}

void FlowControl::forget_path() {
  credit_ = CreditWindow(frame_interval());
  network_.forget_path();
  decoder_.forget_path();
  link_ = {};
  carried_by_.reset();
  apply_interval();
}

bool FlowControl::update(TimePoint now) {
  if (!link_seen_ || now - *link_seen_ > link_state_holds) link_.unsent_bytes = 0;
  if (request_.fixed_quality || !request_.ladder) return false;
  const auto delivered = network_.delivered();
  const bool changed = ladder_.update(
      {network_.rate(), decoder_.rate(), delivered && *delivered < unused_share * network_.rate()},
      now);
  if (changed) apply_interval();
  return changed;
}

bool FlowControl::may_send() const {
  const std::chrono::duration<double> interval = frame_interval();
  return credit_.available() && link_.unsent_bytes * 8.0 <= 1e3 * bitrate_kbps() * interval.count();
}

int FlowControl::bitrate_kbps() const {
  return request_.fixed_quality ? request_.bitrate_kbps : static_cast<int>(network_.rate() * 1e-3);
}

int FlowControl::still_bitrate_kbps(TimePoint now) const {
  return request_.fixed_quality ? request_.bitrate_kbps
                                : static_cast<int>(network_.steady_rate(now) * 1e-3);
}

microseconds FlowControl::time_on_link(std::size_t bytes, TimePoint now) const {
  const double ms = 8.0 * static_cast<double>(bytes) / still_bitrate_kbps(now);
  return microseconds(static_cast<std::int64_t>(1e3 * ms));
}

microseconds FlowControl::standing(TimePoint then) const {
  if (!carried_by_) return 0us;
  return std::max(std::chrono::duration_cast<microseconds>(*carried_by_ - then), 0us);
}

microseconds FlowControl::frame_interval() const {
  if (request_.fixed_quality) return interval_of(request_.fps);
  const double pixels = static_cast<double>(frame_size_px_.x) * frame_size_px_.y;
  const double decoded_fps = std::max(least_paced_fps, decoder_.rate() / pixels);
  return interval_of(std::min(request_.fps * ladder_.rung().fps_share, decoded_fps));
}

microseconds FlowControl::pose_to_photon() const {
  return microseconds(static_cast<std::int64_t>(pose_to_photon_us_));
}

}  // namespace catgs
