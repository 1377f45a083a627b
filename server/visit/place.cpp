#include "server/visit/place.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "server/base/log.h"
#include "server/base/log_event.h"
#include "server/net/wire.h"
#include "server/scenes/scene_entry.h"
#include "server/schedule/on_session_thread.h"

namespace catgs {
namespace {

/// Logs an error, and counts it where it closes a connection.
void note_error(LogFacts facts, const ErrorMessage& error, Metrics& metrics) {
  facts.event = error.fatal ? "session_refused" : "wish_refused";
  facts.code = name_of(error.code);
  const std::string text = fmt::format("{}{}: {}", facts.address, by_link(facts), error.message);
  // Pages that wait for somebody to lead ask again and again.
  if (error.code == ErrorCode::no_leader) return log_debug(facts, "{}", text);
  if (error.code == ErrorCode::internal || error.code == ErrorCode::render_failed)
    log_warning(facts, "{}", text);
  else
    log_refusal(facts, text);
  if (error.code == ErrorCode::bad_message) metrics.bad_messages.Increment();
  if (error.fatal) metrics.sessions_refused.Increment();
}

void present(Place& place, const Present& wish, TimePoint now) {
  Audience& audience = place.audience();
  if (!wish.on) return audience.end_presentation();
  if (!place.may_be_watched())
    return place.send(
        ErrorMessage{ErrorCode::unauthorized, "this link does not let others watch", false});
  if (!audience.presentation().since()) {
    const LogScope about(place.facts());
    log_info({.event = "presents"}, "{} presents", audience.address());
  }
  audience.presentation().begin(wish, now);
}

/// True if the visitor begins to lead or to follow. The first tells a whole company, the second
/// checks a link.
bool begins_shared_tour(const ClientMessage& message, bool leads) {
  if (const auto* wish = std::get_if<Present>(&message)) return wish->on && !leads;
  const auto* wish = std::get_if<Follow>(&message);
  return wish && !wish->watch_token.empty();
}

void refuse_shared_tour(Visit& visit, const ClientMessage& message, TimePoint now) {
  visit.say(ErrorMessage{ErrorCode::rate_limited,
                         "shared tours begin twice a second at most: try again in a moment", false},
            now);
  if (std::holds_alternative<Follow>(message)) visit.say(Lead{LeadState::ended, {}, 0, {}}, now);
}

void ping(Place& place, const ClientConnection& from, Admissions& admissions, const Ping& ping,
          TimePoint now) {
  const bool leads = place.audience().presentation().since().has_value();
  if (Place* const host = leads ? &place : admissions.leader_of(from))
    host->audience().ping({ping.place, leads}, now);
}

void prepare(const VisitContext& around, const std::string& token, const Prepare& wish,
             TimePoint now) {
  const std::string scene_id = around.scenes.resolve(wish.scene_id);
  if (around.authorize(token).allows(scene_id, Use::own_session))
    around.scenes.prepare(scene_id, now);
}

}  // namespace

Place::Place(const VisitContext& around, Admissions& admissions, std::string session_id,
             std::string address)
    : around_(around),
      admissions_(admissions),
      id_(std::move(session_id)),
      executor_(around.executor),
      visit_(around.options.policy, *this, Clock::now()),
      audience_(around.options.max_spectators, std::move(address)),
      tally_(around.counts),
      pings_(2.0, 2.0, Clock::now()),
      preparations_(0.1, 3.0, Clock::now()),
      shared_tours_(2.0, 8.0, Clock::now()),
      refusals_(1.0, 1.0, Clock::now()) {}

Place::~Place() { executor_->close(std::move(stream_)); }

void Place::on_message(ClientConnection& from, const ClientMessage& message, const LinkState& link,
                       TimePoint received) {
  if (audience_.visitor() != &from) return audience_.on_message(from, message);
  visit_.on_link(link, received);
  const auto* hello = std::get_if<Hello>(&message);
  if (hello && visit_.life().state() == VisitState::awaiting_hello) visitor_.device = hello->device;
  if (hello && visit_.life().state() == VisitState::awaiting_hello)
    return admissions_.on_hello(from.shared_from_this(), shared_from_this(), *hello, received);
  if (visit_.life().state() == VisitState::live) {
    if (begins_shared_tour(message, audience_.presentation().since().has_value()) &&
        !shared_tours_.take(received))
      return refusals_.take(received) ? refuse_shared_tour(visit_, message, received) : void();
    if (const auto* wish = std::get_if<Present>(&message)) return present(*this, *wish, received);
    if (const auto* wish = std::get_if<Follow>(&message))
      return admissions_.follow(*this, from, *wish, received);
    if (const auto* pinged = std::get_if<Ping>(&message))
      return pings_.take(received) ? ping(*this, from, admissions_, *pinged, received) : void();
    if (const auto* wish = std::get_if<Prepare>(&message))
      return preparations_.take(received) ? prepare(around_, visitor_.token, *wish, received)
                                          : void();
    if (const auto* reached = std::get_if<Reached>(&message)) {
      const SceneEntry& scene = *visit_.stream().scene();
      if (scene.tours.has_stop(reached->tour, reached->stop))
        tally_.reached(scene.facts.scene_id, visitor_.device, {reached->tour, reached->stop});
      return;
    }
  }
  if (const auto* pose = std::get_if<PoseSample>(&message)) {
    audience_.presentation().moved(*pose, received);
    return around_.frames.pose_arrived(*this, *pose, received);
  }
  if (const auto* ack = std::get_if<Ack>(&message))
    return around_.frames.seen(*this, *ack, received);
  visit_.on_message(message, received);
  around_.frames.changed(*this);
}

void Place::on_frame_sent(ClientConnection& by, const FrameTicket& ticket, std::size_t packet_bytes,
                          TimePoint now) {
  if (audience_.visitor() != &by) return;
  usage_.frame_sent(ticket, now);
  visit_.on_frame_sent(packet_bytes);
}

void Place::on_close(ClientConnection& closed, bool by_leaving) {
  if (audience_.visitor() != &closed) return audience_.remove(closed);
  audience_.detach();
  if (by_leaving || !visitor_.admitted_at)
    visit_.end("the client has left");
  else
    visit_.on_lost(Clock::now());
  around_.frames.changed(*this);
  if (visit_.life().state() == VisitState::closed) admissions_.leave(*this);
}

void Place::refuse(ClientConnection& from, ErrorCode code, std::string_view why) {
  if (audience_.visitor() == &from) {
    visit_.fail(code, why);
    return around_.frames.changed(*this);
  }
  const std::string link_id = audience_.link_of(from);
  audience_.remove(from);
  const ErrorMessage error{code, std::string(why), true};
  const std::string address = from.connection().peer_address();
  LogFacts watching = facts();
  watching.address = address;
  watching.link = link_id;
  note_error(watching, error, around_.metrics);
  from.connection().send(wire::serialize(error));
  from.dismiss(CloseCode::policy_violation, why);
}

SceneAnswer Place::find_scene(const std::string& wish) {
  const std::string scene_id = around_.scenes.resolve(wish);
  if (const auto refusal = around_.authorize(visitor_.token).refusal(scene_id, Use::own_session))
    return ErrorMessage{ErrorCode::unauthorized, *refusal, false};
  return admissions_.find_scene(scene_id, Clock::now());
}

std::vector<std::string> Place::scene_ids() {
  std::vector<std::string> ids = around_.scenes.scene_ids();
  const Permit permit = around_.authorize(visitor_.token);
  std::erase_if(ids, [&](const std::string& id) { return !permit.allows(id, Use::own_session); });
  return ids;
}

void Place::sign(Welcome& welcome) {
  const SessionTokens& tokens = around_.tokens;
  welcome.session_id = id_;
  welcome.resume_token =
      tokens.resume_token(id_, welcome.scene.scene_id, around_.options.wall_clock_s());
  if (may_be_watched()) welcome.watch_token = tokens.watch_token(id_);
}

bool Place::may_be_watched() const {
  return around_.options.max_spectators > 0 &&
         around_.authorize(visitor_.token)
             .allows(visit_.stream().scene()->facts.scene_id, Use::watch);
}

void Place::send(const ServerMessage& message) {
  if (const auto* error = std::get_if<ErrorMessage>(&message))
    note_error(facts(), *error, around_.metrics);
  const auto* const welcome = std::get_if<Welcome>(&message);
  // The visitor enters another scene than the one that the leader shows.
  if (welcome && !audience_.is_in(welcome->scene.scene_id)) admissions_.stop_following(*this);
  audience_.send(message, Clock::now());
}

std::vector<std::uint64_t> Place::send(OutgoingFrame frame) {
  return around_.frames.send(*this, std::move(frame));
}

void Place::open_stream(StreamSettings settings) {
  executor_->open(stream_, std::move(settings),
                  on_session_thread<StreamOpened>(
                      around_.io, [self = shared_from_this()](const StreamOpened& opened) {
                        self->around_.frames.stream_opened(*self, opened);
                      }));
}

std::optional<EncoderChoice> Place::other_encoder(Fault why) {
  const EncoderChoice had = visitor_.encoder;
  const bool failed = why == Fault::encoder_failed;
  if (!failed && had.kind == EncoderKind::nvenc) around_.metrics.encoders_refused.Increment();
  auto other = instead_of_nvenc(around_.encoders, had);
  if (!other) return std::nullopt;  // the visit reports why it ends
  const LogScope about(facts());
  log_warning({.event = "encoder_replaced"}, "{} {}: {}", had.text,
              failed ? "failed" : "cannot be opened", other->text);
  visitor_.encoder = *other;
  return other;
}

LogFacts Place::facts() const {
  const SceneEntry* const scene = visit_.stream().scene();
  return {.session = id_,
          .scene = scene ? std::string_view(scene->facts.scene_id) : std::string_view(),
          .address = audience_.address(),
          .link = visitor_.link_id};
}

void Place::on_tick(TimePoint now) {
  StreamControl& stream = visit_.stream();
  visit_.on_tick(now, stream.ready() && stream_->view && stream_->view->outdated());
  if (visit_.life().resumable() && !visit_.life().lost())
    if (auto newer = around_.scenes.newer_representation(*stream.scene()))
      stream.redraw(std::move(newer));
  if (visit_.life().on_show() && stream.scene())
    tally_.on_show(stream.scene()->facts.scene_id, visitor_.device,
                   visit_.statistics().bytes_sent(), now);
  else
    tally_.off_show();
  audience_.keep_talking(now);
  if (audience_.wants_idr(now)) visit_.stream().idr().request();
}

void Place::account_for(const FrameResult& result, TimePoint now) {
  const FrameTicket& ticket = result.frame.ticket;
  Metrics& metrics = around_.metrics;
  const LogScope about(facts());
  if (!result.ok) log_warning({.event = "frame_failed"}, "a frame failed: {}", result.message);
  (!result.ok       ? metrics.frames_failed
   : ticket.refined ? metrics.frames_refined
                    : metrics.frames_rendered)
      .Increment();
  metrics.list_entries_overflowed.Increment(static_cast<double>(result.stats.overflowed_entries));
  const auto& stage_ms = result.stats.stage_ms;
  const double device_s = 1e-3 * std::accumulate(stage_ms.begin(), stage_ms.end(), 0.0);
  const glm::dvec2 size_px = ticket.size_px, moving_px = visit_.stream().plan().moving().size_px;
  usage_.frame_ended(ticket, visit_.stream().device() ? device_s : 0.0, now,
                     size_px.x * size_px.y / (moving_px.x * moving_px.y));
}

std::shared_ptr<Place> find_place(const PlaceList& places, std::string_view session_id) {
  const auto it =
      std::ranges::find_if(places, [&](const auto& place) { return place->id() == session_id; });
  return it == places.end() ? nullptr : *it;
}

}  // namespace catgs
