#include "server/visit/visit.h"

#include <cassert>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "server/net/wire.h"

namespace catgs {
namespace {

/// Which markers are hidden from where the camera is, if that is new.
std::optional<HiddenMarkers> look(MarkerVisibility& markers, const StreamControl& stream,
                                  const FrameLoop& frames, TimePoint now) {
  const SceneEntry* const scene = stream.scene();
  if (!scene || !scene->surface || !frames.camera()) return std::nullopt;
  return markers.test(*scene->surface, *frames.camera(), frames.clip(), now);
}

}  // namespace

Visit::Visit(const VisitPolicy& policy, VisitHost& host, TimePoint now)
    : policy_(policy),
      host_(host),
      life_(policy, now),
      last_said_(now),
      picks_(32.0, 32.0, now),
      stream_(host, policy, flow_),
      frames_(policy, flow_),
      statistics_(now) {}

void Visit::say(const ServerMessage& message, TimePoint now) {
  if (life_.state() == VisitState::closed) return;
  last_said_ = now;
  host_.send(message);
}

void Visit::fail(ErrorCode code, std::string_view message) {
  if (life_.state() == VisitState::closed) return;
  host_.send(ErrorMessage{code, std::string(message), true});
  const bool later = code == ErrorCode::server_full || code == ErrorCode::internal;
  end(message, later ? CloseCode::try_again_later : CloseCode::policy_violation);
}

void Visit::end(std::string_view reason, CloseCode code) {
  if (life_.state() == VisitState::closed) return;
  life_.enter(VisitState::closed);
  host_.close(code, reason);
}

void Visit::on_message(const ClientMessage& message, TimePoint now) {
  const VisitState state = life_.state();
  if (state == VisitState::closed || std::holds_alternative<UnknownMessage>(message)) return;
  if (std::holds_alternative<Bye>(message)) return end("bye", CloseCode::normal);
  if (const auto* hello = std::get_if<Hello>(&message)) {
    if (state != VisitState::awaiting_hello) return fail(ErrorCode::bad_message, "a second hello");
    if (hello->version < wire::version)
      return fail(ErrorCode::unsupported_version,
                  fmt::format("this server speaks catgs wire version {}, the client at most {}: "
                              "reload the page or update the client",
                              wire::version, hello->version));
    hello_ = *hello;
    return ask_again(now);
  }
  if (state == VisitState::awaiting_hello)
    return fail(ErrorCode::bad_message, "the first message has to be a hello");
  if (state != VisitState::queued) return on_live_message(message, now);
  if (const auto* settings = std::get_if<Settings>(&message)) hello_.settings = *settings;
  if (const auto* pause = std::get_if<Pause>(&message)) life_.pause(pause->paused);
}

void Visit::on_live_message(const ClientMessage& message, TimePoint now) {
  if (const auto* sample = std::get_if<PoseSample>(&message)) {
    if (frames_.pose_arrived(*sample, now)) life_.note_activity(now);
    if (const auto hidden = look(markers_, stream_, frames_, now)) say(*hidden, now);
    return;
  }
  if (const auto* ack = std::get_if<Ack>(&message)) {
    if (frames_.acknowledged(*ack, now) && ack->dropped) statistics_.frame_dropped_by_client();
    return;
  }
  if (std::holds_alternative<RequestIdr>(message)) return stream_.idr().request();
  life_.note_activity(now);
  if (const auto* path = std::get_if<PosePath>(&message)) {
    frames_.follow(*path);
  } else if (const auto* settings = std::get_if<Settings>(&message)) {
    stream_.plan().request(*settings, now);
    frames_.see_with(stream_.plan().stereo(), now);
  } else if (const auto* selected = std::get_if<SelectScene>(&message)) {
    if (within(selected_, policy_.select_gap, now))
      awaited_scene_ = selected->scene_id;
    else
      select(selected->scene_id, now);
  } else if (const auto* pause = std::get_if<Pause>(&message)) {
    if (life_.paused() && !pause->paused) {
      // A hidden page presents nothing, so it never acknowledged its frames in flight.
      flow_.forget_in_flight();
      stream_.idr().missed();
    }
    life_.pause(pause->paused);
  } else if (const auto* box = std::get_if<ClipBox>(&message)) {
    frames_.clip(*box, now);
  } else if (const auto* pick = std::get_if<Pick>(&message)) {
    if (picks_.take(now)) say(stream_.scene()->seen_along(*pick, frames_.clip()), now);
  } else if (const auto* markers = std::get_if<Markers>(&message)) {
    markers_.watch(*markers);
  }
}

void Visit::ask_again(TimePoint now) {
  const VisitState state = life_.state();
  if (state != VisitState::awaiting_hello && state != VisitState::queued) return;
  auto answer = host_.admit(hello_);
  if (const auto* error = std::get_if<ErrorMessage>(&answer))
    return fail(error->code, error->message);
  awaited_scene_.reset();
  life_.enter(VisitState::queued);
  if (const auto* position = std::get_if<QueuePosition>(&answer)) return say(*position, now);
  if (const auto* awaited = std::get_if<SceneAwaited>(&answer))
    return await_scene(hello_.scene_id, *awaited, now);
  life_.enter(VisitState::opening);
  begin(hello_, std::get<Admission>(std::move(answer)), now);
}

bool Visit::begin(const Hello& hello, Admission admission, TimePoint now) {
  life_.note_activity(now);
  if (admission.scene.get() != stream_.scene()) {
    frames_.enter_scene(admission.scene->facts);
    markers_.watch({});
  }
  const bool goes_on = stream_.begin(std::move(admission), hello);
  frames_.see_with(stream_.plan().stereo(), now);
  frames_.go_on_from(hello, now);
  if (!goes_on) stream_.open();
  return goes_on;
}

void Visit::select(const std::string& scene_id, TimePoint now) {
  selected_ = now;
  auto found = host_.find_scene(scene_id);
  if (const auto* awaited = std::get_if<SceneAwaited>(&found))
    return await_scene(scene_id, *awaited, now);
  const bool waited = std::exchange(awaited_scene_, {}).has_value();
  if (const auto* error = std::get_if<ErrorMessage>(&found)) {
    say(*error, now);
    if (!waited) return;
    stream_.owe_welcome();  // the page shows its waiting screen
    return stream_.opening() ? void() : say(stream_.introduction(), now);
  }
  auto& scene = std::get<std::shared_ptr<const SceneEntry>>(found);
  frames_.enter_scene(scene->facts);
  markers_.watch({});
  stream_.enter_scene(std::move(scene));
  stream_.open();
}

void Visit::await_scene(const std::string& scene_id, const SceneAwaited& awaited, TimePoint now) {
  awaited_scene_ = scene_id;
  if (within(told_of_scene_, speak_at_least_every, now)) return;
  told_of_scene_ = now;
  say(QueuePosition{1, awaited.estimate, true}, now);
}

void Visit::on_stream_opened(const StreamOpened& opened, TimePoint now) {
  if (life_.state() == VisitState::closed) return;
  stream_.on_opened(opened);
  if (stream_.opening()) return;
  if (!opened.ok)
    return fail(ErrorCode::internal, "the stream cannot be opened: " + opened.message);
  life_.enter(VisitState::live);
  life_.note_activity(now);
  say(stream_.introduction(), now);
}

void Visit::on_lost(TimePoint now) {
  life_.lose(now);
  frames_.forget_started();
  flow_.forget_in_flight();
}

void Visit::on_resumed(const Hello& hello, Admission admission, TimePoint now) {
  life_.resume(now);
  frames_.forget_started();
  flow_.forget_path();
  const bool goes_on = begin(hello, std::move(admission), now);
  if (goes_on && life_.state() == VisitState::live && !stream_.opening())
    say(stream_.introduction(), now);
}

std::optional<FrameCandidate> Visit::next_frame() const {
  if (!life_.on_show() || !stream_.ready()) return std::nullopt;
  auto frame = frames_.next(stream_.idr(), stream_.shows_still_size());
  if (frame) frame->device = stream_.device();
  return frame;
}

FrameOrder Visit::start_frame(TimePoint now) {
  assert(life_.on_show());
  frames_.see_with(stream_.plan().stereo(), now);
  // Only time decides. If credit was missing, the first picture of a pose may already be the still.
  FrameOrder order = stream_.begin_frame(frames_.rests(now), now);
  frames_.start(order, now);
  // An orthographic picture is moved without them, and on a slow link the picture needs the bits.
  constexpr int least_share = 6;
  const int eyes = order.request.stereo ? 2 : 1;
  const bool has_bits =
      1000 * order.bitrate_kbps >= eyes * least_share * depth_bits * order.real_fps;
  if (stream_.plan().depths() && order.ticket.view_height == 0.0f && has_bits)
    order.request.depth_cells = depth_cells_of(order.ticket.size_px, eyes);
  return order;
}

void Visit::on_frame(FrameResult result, TimePoint now) {
  if (life_.state() == VisitState::closed) return;
  stream_.end_frame();
  if (!result.ok) {
    frames_.failed();
    if (stream_.mend(result)) return;
    if (result.fault == Fault::encoder_unavailable)
      return fail(ErrorCode::internal, "the stream cannot be opened: " + result.message);
    if (frames_.failed_again())
      return fail(ErrorCode::render_failed, "frames fail: " + result.message);
    if (result.fault == Fault::device_failed) stream_.open();  // perhaps on another device
    return;
  }
  if (!frames_.made(result, now)) return;
  last_said_ = now;
  if (stream_.scene()->in_pages && !result.frame.ticket.refined)
    statistics_.pages_drawn(result.stats, frames_.detail_px());
  if (stream_.describe(result)) say(stream_.introduction(), now);
  const auto dropped = host_.send(std::move(result.frame));
  for (const std::uint64_t id : dropped) flow_.lost(id);
  if (dropped.empty()) return;
  stream_.idr().dropped(now);
  statistics_.frames_lost(dropped.size());
}

void Visit::on_tick(TimePoint now, int sessions, bool outdated) {
  if (life_.hello_is_late(now))
    return fail(ErrorCode::bad_message, "no hello within the time limit");
  if (awaited_scene_ && !life_.lost()) {
    if (life_.state() == VisitState::queued)
      ask_again(now);
    else if (life_.state() == VisitState::live)
      select(std::string(*awaited_scene_), now);
  }
  if (life_.state() == VisitState::closed || life_.state() == VisitState::queued) return;
  if (life_.lost()) {
    if (life_.grace_is_over(now)) life_.enter(VisitState::closed);
    return;
  }
  stream_.plan().on_tick(now);
  frames_.see_with(stream_.plan().stereo(), now);
  if (const auto hidden = look(markers_, stream_, frames_, now)) say(*hidden, now);
  if (outdated) frames_.outdate();
  if (const auto idle = life_.idle_message(now)) {
    if (idle->fatal) return fail(idle->code, idle->message);
    say(*idle, now);
  }
  if (const auto stats = statistics_.take(flow_, sessions, now)) say(*stats, now);
  if (now - last_said_ >= speak_at_least_every) say(heartbeat_at(now), now);
}

}  // namespace catgs
