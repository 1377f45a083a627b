#include "server/visit/session.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "server/base/log.h"
#include "server/base/log_event.h"
#include "server/base/scene_id.h"
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
  // Pages that wait for a host ask again and again.
  if (error.code == ErrorCode::no_leader) return log_debug(facts, "{}", text);
  if (error.code == ErrorCode::internal || error.code == ErrorCode::render_failed)
    log_warning(facts, "{}", text);
  else
    log_refusal(facts, text);
  if (error.code == ErrorCode::bad_message) metrics.bad_messages.Increment();
  if (error.fatal) metrics.sessions_refused.Increment();
}

/// A message of a live visit that concerns the server around it.
struct Request {
  Session& session;
  ClientConnection& from;
  const ClientMessage& message;
  const VisitContext& around;
  Admissions& admissions;
  VisitTally& tally;
  TimePoint now;

  template <typename Message>
  [[nodiscard]] const Message& as() const {
    return std::get<Message>(message);
  }
  [[nodiscard]] bool hosts() const { return session.audience().tour().since().has_value(); }
};

template <typename Message>
bool is(const ClientMessage& message) {
  return std::holds_alternative<Message>(message);
}

bool always(const Request&) { return true; }
// The first tells all participants, the second checks a link.
bool begins_to_host(const Request& r) { return r.as<Present>().on && !r.hosts(); }
bool begins_to_follow(const Request& r) { return !r.as<Follow>().watch_token.empty(); }

bool may_host(const Request& r) { return !r.as<Present>().on || r.session.may_be_watched(); }
bool may_enter(const Request& r) {
  return r.around.authorize(r.session.visitor().token)
      .allows(r.around.scenes.resolve(r.as<Prepare>().scene_id), Use::own_session);
}
bool is_stop(const Request& r) {
  const auto& [tour, stop] = r.as<Reached>();
  return r.session.visit().stream().scene()->tours.has_stop(tour, stop);
}

void present(const Request& r) {
  Audience& audience = r.session.audience();
  if (!r.as<Present>().on) return audience.end_tour();
  if (!r.hosts()) {
    const LogScope about(r.session.facts());
    log_info({.event = "presents"}, "{} presents", audience.address());
  }
  audience.tour().begin(r.as<Present>(), r.now);
}

void follow(const Request& r) { r.admissions.follow(r.session, r.from, r.as<Follow>(), r.now); }

void ping(const Request& r) {
  Session* const host = r.hosts() ? &r.session : r.admissions.host_of(r.from);
  const Pinged pinged{r.as<Ping>().place, r.hosts()};
  if (host && host->audience().tour().ping(pinged, r.now)) host->audience().tell(pinged, r.now);
}

void prepare(const Request& r) {
  r.around.scenes.prepare(r.around.scenes.resolve(r.as<Prepare>().scene_id), r.now);
}

void reach(const Request& r) {
  const auto& [tour, stop] = r.as<Reached>();
  r.tally.reached(r.session.visit().stream().scene()->facts.scene_id, r.session.visitor().device,
                  {tour, stop}, r.session.visitor().link_id);
}

void show(const Request& r) { r.session.audience().tour().show(r.as<Show>()); }

/// How requests of one kind are limited, who may send them, and who handles them. A refusal
/// without a text is not told.
struct Rule {
  bool (*is_for)(const ClientMessage&);
  RateLimit RequestLimits::*limit;  // null: none but that of all messages
  bool (*is_limited)(const Request&);
  std::string_view too_many;
  bool (*may)(const Request&);
  std::string_view forbidden;
  void (*handle)(const Request&);
};

constexpr std::string_view too_many_tours =
    "shared tours begin twice a second at most: try again in a moment";
constexpr Rule rules[] = {
    {is<Present>, &RequestLimits::shared_tours, begins_to_host, too_many_tours, may_host,
     "this link does not let others watch", present},
    {is<Follow>, &RequestLimits::shared_tours, begins_to_follow, too_many_tours, always, "",
     follow},
    {is<Ping>, &RequestLimits::pings, always, "", always, "", ping},
    {is<Prepare>, &RequestLimits::preparations, always, "", may_enter, "", prepare},
    {is<Reached>, nullptr, always, "", is_stop, "", reach},
    {is<Show>, nullptr, always, "", always, "", show},
};

void refuse(const Request& r, ErrorCode code, std::string_view why) {
  if (why.empty()) return;
  r.session.visit().say(ErrorMessage{code, std::string(why), false}, r.now);
  if (is<Follow>(r.message)) r.session.visit().say(Lead{LeadState::ended, {}, 0, {}}, r.now);
}

void handle(const Rule& rule, const Request& r, RequestLimits& limits) {
  if (rule.limit && rule.is_limited(r) && !(limits.*rule.limit).take(r.now)) {
    if (!rule.too_many.empty() && limits.refusals.take(r.now))
      refuse(r, ErrorCode::rate_limited, rule.too_many);
    return;
  }
  rule.may(r) ? rule.handle(r) : refuse(r, ErrorCode::unauthorized, rule.forbidden);
}

}  // namespace

SceneAnswer find_scene(SceneSource& scenes, const std::string& scene_id, TimePoint now) {
  if (scenes.has(scene_id)) return scenes.want(scene_id, now);
  return ErrorMessage{ErrorCode::unknown_scene, no_such_scene(scene_id), false};
}

Session::Session(const VisitContext& around, Admissions& admissions, std::string session_id,
                 std::string address)
    : around_(around),
      admissions_(admissions),
      id_(std::move(session_id)),
      executor_(around.executor),
      visit_(around.options.policy, *this, Clock::now()),
      audience_(around.options.max_spectators, std::move(address)),
      tally_(around.counts) {}

Session::~Session() { executor_->close(std::move(stream_)); }

void Session::on_message(ClientConnection& from, const ClientMessage& message,
                         const LinkState& link, TimePoint received) {
  if (audience_.visitor() != &from) return audience_.on_message(from, message);
  visit_.flow().observed(link, received);
  if (const auto* pose = std::get_if<PoseSample>(&message)) {
    audience_.tour().moved(*pose, received);
    return around_.frames.pose_arrived(*this, *pose, received);
  }
  if (const auto* ack = std::get_if<Ack>(&message))
    return around_.frames.seen(*this, *ack, received);
  const VisitState state = visit_.life().state();
  const auto* hello = std::get_if<Hello>(&message);
  if (hello && state == VisitState::awaiting_hello) {
    visitor_.device = hello->device;
    return admissions_.on_hello(from.shared_from_this(), shared_from_this(), *hello, received);
  }
  const auto* const rule =
      std::ranges::find_if(rules, [&](const Rule& candidate) { return candidate.is_for(message); });
  if (state == VisitState::live && rule != std::end(rules))
    return handle(*rule, {*this, from, message, around_, admissions_, tally_, received}, limits_);
  visit_.on_message(message, received);
  around_.frames.changed(*this);
}

void Session::on_frame_sent(ClientConnection& by, const FrameTicket& ticket,
                            std::size_t packet_bytes, TimePoint now) {
  if (audience_.visitor() != &by) return;
  usage_.frame_sent(ticket, now);
  visit_.statistics().frame_sent(packet_bytes);
}

void Session::on_close(ClientConnection& closed, bool by_leaving) {
  if (audience_.visitor() != &closed) return audience_.remove(closed);
  audience_.detach();
  if (by_leaving || !visitor_.admitted_at)
    visit_.end("the client has left");
  else
    visit_.on_lost(Clock::now());
  around_.frames.changed(*this);
  if (visit_.life().state() == VisitState::closed) admissions_.leave(*this);
}

void Session::refuse(ClientConnection& from, ErrorCode code, std::string_view why) {
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

SceneAnswer Session::find_scene(const std::string& name) {
  const std::string scene_id = around_.scenes.resolve(name);
  if (const auto refusal = around_.authorize(visitor_.token).refusal(scene_id, Use::own_session))
    return ErrorMessage{ErrorCode::unauthorized, *refusal, false};
  return catgs::find_scene(around_.scenes, scene_id, Clock::now());
}

void Session::sign(Welcome& welcome) {
  const SessionTokens& tokens = around_.tokens;
  welcome.scene_ids = around_.scenes.scene_ids();
  const Permit permit = around_.authorize(visitor_.token);
  std::erase_if(welcome.scene_ids,
                [&](const std::string& id) { return !permit.allows(id, Use::own_session); });
  welcome.session_id = id_;
  welcome.resume_token =
      tokens.resume_token(id_, welcome.scene.scene_id, around_.options.wall_clock_s());
  if (may_be_watched()) welcome.watch_token = tokens.watch_token(id_);
}

bool Session::may_be_watched() const {
  return around_.options.max_spectators > 0 &&
         around_.authorize(visitor_.token)
             .allows(visit_.stream().scene()->facts.scene_id, Use::watch);
}

void Session::send(const ServerMessage& message) {
  if (const auto* error = std::get_if<ErrorMessage>(&message))
    note_error(facts(), *error, around_.metrics);
  const auto* const welcome = std::get_if<Welcome>(&message);
  // The visitor enters another scene than the one that the host shows.
  if (welcome && !audience_.is_in(welcome->scene.scene_id)) admissions_.stop_following(*this);
  audience_.send(message, Clock::now());
}

std::vector<std::uint64_t> Session::send(OutgoingFrame frame) {
  auto dropped = audience_.send(std::move(frame), Clock::now());
  around_.metrics.frames_dropped_by_server.Increment(static_cast<double>(dropped.size()));
  return dropped;
}

void Session::open_stream(StreamSettings settings) {
  executor_->open(stream_, std::move(settings),
                  on_session_thread<StreamOpened>(
                      around_.io, [self = shared_from_this()](const StreamOpened& opened) {
                        self->around_.frames.stream_opened(*self, opened);
                      }));
}

std::optional<EncoderChoice> Session::other_encoder(Fault why) {
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

LogFacts Session::facts() const {
  const SceneEntry* const scene = visit_.stream().scene();
  return {.session = id_,
          .scene = scene ? std::string_view(scene->facts.scene_id) : std::string_view(),
          .address = audience_.address(),
          .link = visitor_.link_id};
}

void Session::on_tick(TimePoint now, int sessions) {
  StreamControl& stream = visit_.stream();
  visit_.on_tick(now, sessions, stream.ready() && stream_->view && stream_->view->outdated());
  if (visit_.life().resumable() && !visit_.life().lost())
    if (auto newer = around_.scenes.newer_representation(*stream.scene()))
      stream.redraw(std::move(newer));
  if (visit_.life().on_show() && stream.scene())
    tally_.on_show(stream.scene()->facts.scene_id, visitor_.device,
                   visit_.statistics().bytes_sent(), now, visitor_.link_id);
  else
    tally_.off_show();
  audience_.keep_talking(now, [this](const auto& id) { return scene_pass(around_, visitor_, id); });
  if (audience_.wants_idr(now)) visit_.stream().idr().request();
}

void Session::account_for(const FrameResult& result, TimePoint now) {
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
  const double device_s = visit_.stream().device()
                              ? 1e-3 * std::accumulate(stage_ms.begin(), stage_ms.end(), 0.0)
                              : 0.0;
  if (result.ok && !ticket.refined) {
    metrics.device_seconds.Increment(device_s);
    if (result.stats.kind == FrameKind::sub) metrics.frames_speculated.Increment();
    if (result.stats.cut_window) metrics.windows_cut.Increment();
    visit_.statistics().frame_drawn(result.stats, device_s);
  }
  const glm::dvec2 size_px = ticket.size_px, moving_px = visit_.stream().plan().moving().size_px;
  usage_.frame_ended(ticket, device_s, now, size_px.x * size_px.y / (moving_px.x * moving_px.y));
}

std::string scene_pass(const VisitContext& around, const Visitor& host,
                       const std::string& scene_id) {
  return around.tokens.scene_pass(scene_id, around.authorize(host.token),
                                  around.options.wall_clock_s());
}

std::shared_ptr<Session> find_session(const SessionList& sessions, std::string_view session_id) {
  const auto it = std::ranges::find_if(
      sessions, [&](const auto& session) { return session->id() == session_id; });
  return it == sessions.end() ? nullptr : *it;
}

}  // namespace catgs
