#pragma once

// A Visit, a link and a client in simulated time.

#include "tests/server/visit/visit_fixture.h"
#include "tests/support/simulated_link.h"
#include "tests/support/test.h"

namespace catgs::test {

using std::chrono::microseconds;

struct FlowScenario {
  LinkPlan link;
  ClientPlan client;
  glm::ivec2 size_px{1280, 720};
  glm::ivec2 still_size_px{0};  // 0: the same
  int fps = 60;
  int max_bitrate_kbps = 40'000;
  bool fixed_quality = false;
  double demand_bits_per_pixel = 1.0;  // the most that the content is worth
  double sharp_bits_per_pixel = 0.6;   // of a still and its refinements, together
  microseconds frame_cost{8'000};      // rendering and encoding
  /// The camera stands still in these.
  std::vector<Outage> rests;
};

/// What became of a frame.
struct FrameTrace {
  FrameTicket ticket;
  std::size_t bytes = 0;
  int bitrate_kbps = 0;
  microseconds sent{0};
  microseconds arrival{0};
  microseconds queueing{0};  // on the way: all but the link's own delay
  bool idr = false;
  bool sharp = false;
};

class FlowSimulation {
 public:
  explicit FlowSimulation(FlowScenario scenario)
      : scenario_(std::move(scenario)), link_(scenario_.link), client_(scenario_.client) {
    policy_.max_bitrate_kbps = 200'000;
    auto scene = std::make_shared<SceneEntry>();
    scene->facts.near_z = 0.2f;
    host_.admission = Admission{scene, {EncoderKind::x264, Codec::h264, "libx264"}};
    Hello hello;
    hello.version = 1;
    hello.viewport_px = scenario_.size_px;
    hello.decoders = {Codec::h264};
    if (scenario_.still_size_px.x > 0) {
      hello.settings.size_px = scenario_.size_px;
      hello.settings.still_size_px = scenario_.still_size_px;
    }
    hello.settings.max_fps = scenario_.fps;
    hello.settings.max_bitrate_kbps = scenario_.max_bitrate_kbps;
    hello.settings.fixed_quality = scenario_.fixed_quality;
    visit_.on_message(hello, start_);
  }

  /// Runs until `end` after the start, in steps of a millisecond.
  void run(microseconds end) {
    for (; now_ < end; now_ += 1ms) step();
  }

  [[nodiscard]] const std::vector<FrameTrace>& frames() const { return frames_; }
  [[nodiscard]] const Visit& visit() const { return visit_; }
  /// How often frames of the moving camera got another size, the first one included.
  [[nodiscard]] int sizes() const {
    int count = 0;
    glm::ivec2 size_px{0};
    for (const FrameTrace& frame : frames_)
      if (!frame.ticket.still &&
          std::exchange(size_px, frame.ticket.size_px) != frame.ticket.size_px)
        ++count;
    return count;
  }
  /// From a time until a sharp picture of this size has come.
  [[nodiscard]] std::optional<microseconds> sharp_after(microseconds from,
                                                        glm::ivec2 size_px) const {
    for (const FrameTrace& frame : frames_)
      if (frame.sent >= from && frame.sharp && frame.ticket.size_px == size_px)
        return frame.arrival - from;
    return std::nullopt;
  }
  [[nodiscard]] int presented(microseconds from, microseconds to) const {
    return static_cast<int>(std::ranges::count_if(
        presented_, [&](const Presented& p) { return p.at >= from && p.at < to; }));
  }
  /// The largest age of a pose when its picture was shown.
  [[nodiscard]] microseconds oldest_shown(microseconds from, microseconds to) const {
    microseconds oldest{0};
    for (const Presented& p : presented_)
      if (p.at >= from && p.at < to) oldest = std::max(oldest, p.pose_age);
    return oldest;
  }
  /// The longest time without a new picture.
  [[nodiscard]] microseconds longest_freeze(microseconds from, microseconds to) const {
    microseconds longest{0}, shown = from;
    for (const Presented& p : presented_)
      if (p.at >= from && p.at < to) longest = std::max(longest, p.at - std::exchange(shown, p.at));
    return std::max(longest, to - shown);
  }
  /// Of the frames sent in a time.
  [[nodiscard]] std::vector<FrameTrace> sent(microseconds from, microseconds to) const {
    std::vector<FrameTrace> some;
    std::ranges::copy_if(frames_, std::back_inserter(some), [&](const FrameTrace& frame) {
      return frame.sent >= from && frame.sent < to;
    });
    return some;
  }
  [[nodiscard]] microseconds longest_queueing(microseconds from, microseconds to) const {
    microseconds longest{0};
    for (const FrameTrace& frame : sent(from, to)) longest = std::max(longest, frame.queueing);
    return longest;
  }
  /// Share of the frames sent in a time that queued for at most `bound`.
  [[nodiscard]] double share_queueing_at_most(microseconds bound, microseconds from,
                                              microseconds to) const {
    const auto some = sent(from, to);
    const auto quick = std::ranges::count_if(
        some, [&](const FrameTrace& frame) { return frame.queueing <= bound; });
    return static_cast<double>(quick) / static_cast<double>(std::max<std::size_t>(1, some.size()));
  }
  [[nodiscard]] double sent_kbps(microseconds from, microseconds to) const {
    double bits = 0.0;
    for (const FrameTrace& frame : sent(from, to)) bits += 8.0 * static_cast<double>(frame.bytes);
    return bits * 1e3 / static_cast<double>((to - from).count());
  }

 private:
  struct Presented {
    microseconds at;
    microseconds pose_age;
  };

  TimePoint at(microseconds time) const { return start_ + time; }

  void step() {
    if (host_.opened.size() > streams_answered_) open_stream();
    deliver_poses();
    deliver_acks();
    if (now_ % 250ms == 0us) visit_.on_tick(at(now_));
    if (rendering_ && now_ >= rendered_at_) finish_frame();
    if (!rendering_) start_frame();
  }

  void open_stream() {
    ++streams_answered_;
    visit_.on_stream_opened({true, "", Codec::h264, "avc1.42C01F", "libx264"}, at(now_));
  }

  LinkState link_state() const {
    return {0, 0, 0, static_cast<std::uint32_t>(link_.unsent_bytes(now_))};
  }

  /// One at every refresh, on its way for the link's delay.
  void deliver_poses() {
    const microseconds sampled = now_ - scenario_.link.delay;
    if (sampled < next_pose_) return;
    next_pose_ = sampled + scenario_.client.refresh;
    if (client_.asleep(sampled)) return;
    const bool rests = std::ranges::any_of(scenario_.rests, [&](const Outage& rest) {
      return sampled >= rest.from && sampled < rest.to;
    });
    if (!rests) x_ += 0.01f;
    PoseSample sample;
    sample.pose_id = ++pose_id_;
    sample.client_time_us = client_.clock_us(sampled);
    sample.world_from_camera.position.x = x_;
    sample.fov_y_rad = 1.0f;
    visit_.flow().observed(link_state(), at(now_));
    visit_.on_message(sample, at(now_));
  }

  void deliver_acks() {
    for (const Ack& ack : client_.acknowledge(now_)) acks_.push_back({now_, ack});
    while (!acks_.empty() && acks_.front().first + scenario_.link.delay <= now_) {
      const Ack ack = acks_.front().second;
      acks_.pop_front();
      if (!ack.dropped)
        presented_.push_back({now_ - scenario_.link.delay, microseconds(ack.pose_age_us)});
      visit_.flow().observed(link_state(), at(now_));
      visit_.on_message(ack, at(now_));
    }
  }

  void start_frame() {
    const auto candidate = visit_.next_frame();
    if (!candidate || candidate->ready > at(now_)) return;
    order_ = visit_.start_frame(at(now_));
    rendering_ = true;
    rendered_at_ = now_ + scenario_.frame_cost;
  }

  /// The encoder fills its share of the bitrate, within a fifth, as far as the content needs it.
  void finish_frame() {
    rendering_ = false;
    const glm::ivec2 size = order_.ticket.size_px;
    const double budget = 125.0 * order_.bitrate_kbps / order_.real_fps;
    const double demand = scenario_.demand_bits_per_pixel / 8.0 * size.x * size.y;
    const double fill = 0.8 + 0.2 * static_cast<double>(random_() % 1000) * 1e-3;
    FrameResult result;
    result.ok = true;
    result.frame.ticket = order_.ticket;
    result.frame.ticket.idr = order_.force_idr;
    result.frame.ticket.render = result.frame.ticket.encode = {at(now_), at(now_)};
    result.frame.bitstream.resize(
        static_cast<std::size_t>(std::min(budget * (order_.force_idr ? 1.15 : fill), demand)) + 1);
    result.codec_string = "avc1.42C01F";
    if (!order_.ticket.refined) still_bits_ = 0.0;
    still_bits_ += 8.0 * static_cast<double>(result.frame.bitstream.size());
    result.sharp = still_bits_ >= scenario_.sharp_bits_per_pixel * size.x * size.y;
    FrameTrace trace;
    trace.ticket = result.frame.ticket;
    trace.bytes = result.frame.bitstream.size();
    trace.bitrate_kbps = order_.bitrate_kbps;
    trace.sent = now_;
    trace.idr = order_.force_idr;
    trace.sharp = result.sharp;
    visit_.on_frame(std::move(result), at(now_));
    host_.frames.clear();
    trace.arrival = link_.send(trace.bytes, now_);
    trace.queueing = trace.arrival - trace.sent - scenario_.link.delay;
    client_.receive(trace.ticket, trace.arrival);
    visit_.statistics().frame_sent(trace.bytes);
    frames_.push_back(trace);
  }

  const FlowScenario scenario_;
  SimulatedLink link_;
  SimulatedClient client_;
  const TimePoint start_ = TimePoint{} + 1h;
  microseconds now_{0};
  VisitPolicy policy_;
  FakeHost host_;
  Visit visit_{policy_, host_, start_};

  std::size_t streams_answered_ = 0;
  microseconds next_pose_{0};
  std::uint64_t pose_id_ = 0;
  float x_ = 0.0f;
  std::deque<std::pair<microseconds, Ack>> acks_;
  bool rendering_ = false;
  microseconds rendered_at_{0};
  FrameOrder order_;
  double still_bits_ = 0.0;  // of the picture on show
  std::minstd_rand random_{7};
  std::vector<FrameTrace> frames_;
  std::vector<Presented> presented_;
};

}  // namespace catgs::test
