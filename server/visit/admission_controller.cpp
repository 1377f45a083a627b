#include "server/visit/admission_controller.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "server/base/log_event.h"
#include "server/base/scene_id.h"
#include "server/flow/frame_size.h"
#include "server/net/trusted_proxies.h"

namespace catgs {
namespace {

constexpr std::chrono::seconds time_to_measure{3};  // at most, for a moving camera

double megapixels(glm::ivec2 size_px) { return 1e-6 * size_px.x * size_px.y; }

}  // namespace

AdmissionController::AdmissionController(const VisitContext& around, const SessionList& sessions,
                                         const MachineUse& machine)
    : around_(around),
      sessions_(sessions),
      machine_(machine),
      budget_({machine.cpus(), static_cast<double>(around.devices.views().size())},
              around.options.min_fps),
      queue_(around.options.max_queue) {}

std::variant<std::string, ErrorMessage> AdmissionController::choose(const Hello& hello) const {
  const Permit permit = around_.authorize(hello.token);
  std::string wanted = around_.scenes.resolve(hello.scene_id);
  if (hello.scene_id.empty()) {
    const std::vector<std::string> ids = around_.scenes.scene_ids();
    const auto allowed = std::ranges::find_if(
        ids, [&](const std::string& id) { return permit.allows(id, Use::own_session); });
    if (!ids.empty()) wanted = allowed != ids.end() ? *allowed : ids.front();
  }
  // Check the token first, so that a refusal tells nothing about the scenes here.
  if (const auto refusal = permit.refusal(wanted, Use::own_session))
    return ErrorMessage{ErrorCode::unauthorized, *refusal, true};
  if (!around_.scenes.has(wanted))
    return ErrorMessage{ErrorCode::unknown_scene, no_such_scene(wanted), true};
  if (!best_encoder(around_.encoders, hello.decoders)) {
    std::string offer;
    for (const auto& encoder : around_.encoders)
      offer += (offer.empty() ? "" : "; ") + encoder.text;
    return ErrorMessage{ErrorCode::no_common_codec,
                        "the client decodes nothing that this server encodes: " + offer, true};
  }
  return wanted;
}

AdmissionBudget::Offer AdmissionController::offer_for(
    const Hello& hello, std::span<const SessionDemand> present) const {
  if (shut_ || admitted_ >= around_.options.max_sessions) return {Room::no};
  const FlowRequest request =
      request_within(around_.options.policy, hello.settings, hello.viewport_px);
  return budget_.offer(present, {std::nullopt, megapixels(request.size_px), request.fps});
}

std::vector<Session*> AdmissionController::admitted_sessions() const {
  std::vector<Session*> admitted;
  for (const auto& session : sessions_)
    if (session->visitor().admitted_at) admitted.push_back(session.get());
  return admitted;
}

std::vector<SessionDemand> AdmissionController::demands() const {
  const TimePoint now = Clock::now();
  std::vector<SessionDemand> demands;
  for (Session* const session : admitted_sessions()) {
    const Visit& visit = session->visit();
    const PicturePlan& plan = visit.stream().plan();
    const bool fresh =
        now - *session->visitor().admitted_at < time_to_measure && !visit.life().rests(now);
    demands.push_back({session->usage().frame_cost(), megapixels(plan.moving().size_px),
                       plan.moving().fps, fresh, plan.pixel_share()});
  }
  return demands;
}

void AdmissionController::set_pixel_share(Session& session, double share) {
  PicturePlan& plan = session.visit().stream().plan();
  const double work = frame_work(megapixels(plan.moving().size_px));
  plan.use_pixel_share(share);
  around_.frames.changed(session);
  const glm::ivec2 size_px = plan.moving().size_px;
  session.usage().scale_frame_cost(frame_work(megapixels(size_px)) / work);
  const LogScope about(session.facts());
  log_debug({.event = "picture_size"},
            "its pictures are {}x{} from now on: there is room for {:.0f} % of their pixels",
            size_px.x, size_px.y, 100.0 * share);
}

void AdmissionController::grow_pictures() {
  if (!queue_.empty()) return;
  if (const auto growth = budget_.growth(demands()))
    set_pixel_share(*admitted_sessions()[growth->session], growth->pixel_share);
}

bool AdmissionController::has_spare_slot(const Hello& hello) const {
  if (!queue_.empty()) return false;
  const auto offer = offer_for(hello, demands());
  return offer.room == Room::yes && offer.pixel_share >= 0.5 &&
         std::ranges::all_of(offer.kept, [](double kept) { return kept >= 1.0; });
}

AdmissionAnswer AdmissionController::admit(Session& session, const Hello& hello) {
  session.visitor().come_by(hello.token, around_.authorize);
  const std::string& id = session.id();
  auto choice = choose(hello);
  if (auto* error = std::get_if<ErrorMessage>(&choice)) {
    queue_.leave(id);
    return std::move(*error);
  }
  const std::string address = limited_as(session.audience().address());
  const auto same_address = std::ranges::count_if(sessions_, [&](const auto& other) {
    return other->visitor().admitted_at && limited_as(other->audience().address()) == address;
  });
  if (same_address >= around_.options.max_sessions_per_address) {
    queue_.leave(id);
    return ErrorMessage{
        ErrorCode::server_full,
        fmt::format("{} sessions from {} already: close one first", same_address, address), true};
  }
  const bool its_turn = queue_.empty() || turn_ == id;
  const auto offer =
      its_turn ? offer_for(hello, demands()) : AdmissionBudget::Offer{.room = Room::no};
  if (its_turn) measuring_ = offer.room == Room::unknown;
  if (offer.room == Room::yes) {
    // A client that waits for its scene holds no slot: the scene may fail to load.
    queue_.leave(id);
    auto scene = find_scene(around_.scenes, std::get<std::string>(choice), Clock::now());
    if (const auto* awaited = std::get_if<SceneAwaited>(&scene)) return *awaited;
    if (auto* error = std::get_if<ErrorMessage>(&scene)) return std::move(*error);
    return let_in(session, hello, std::get<0>(std::move(scene)), offer);
  }
  if (const auto position = queue_.join(id, Clock::now())) return queue_position(*position);
  return ErrorMessage{
      ErrorCode::server_full,
      measuring_
          ? fmt::format("it is being measured what sessions cost here, and {} wait for it: try "
                        "again in {} s",
                        queue_.size(), time_to_measure.count())
          : fmt::format("all {} places are taken, and {} wait for one: try again in a minute",
                        admitted_, queue_.size()),
      true};
}

Admission AdmissionController::let_in(Session& session, const Hello& hello,
                                      std::shared_ptr<const SceneEntry> scene,
                                      const AdmissionBudget::Offer& offer) {
  const auto present = admitted_sessions();
  ++admitted_;
  around_.metrics.sessions_admitted.Increment();
  for (std::size_t i = 0; i < offer.kept.size(); ++i)
    if (offer.kept[i] < 1.0)
      set_pixel_share(*present[i],
                      offer.kept[i] * present[i]->visit().stream().plan().pixel_share());
  const glm::ivec2 size_px =
      request_within(around_.options.policy, hello.settings, hello.viewport_px).size_px;
  Visitor& visitor = session.visitor();
  visitor.encoder = best_encoder(around_.encoders, hello.decoders).value();
  visitor.admitted_at = Clock::now();
  LogFacts facts = session.facts();
  facts.event = "session_admitted";
  facts.scene = scene->facts.scene_id;
  log_info(facts, "{}{} looks at {}, {}x{}, {}", facts.address, by_link(facts), facts.scene,
           hello.viewport_px.x, hello.viewport_px.y, encoder_name(visitor.encoder.kind));
  return {std::move(scene), visitor.encoder,
          machine_.initial_effort(admitted_, scaled_size(size_px, std::sqrt(offer.pixel_share))),
          offer.pixel_share};
}

void AdmissionController::leave(Session& session, TimePoint now) {
  if (const auto admitted_at = session.visitor().admitted_at) {
    --admitted_;
    queue_.session_ended(now - *admitted_at);
  }
  queue_.leave(session.id());
}

void AdmissionController::on_newcomer(TimePoint now) {
  if (queue_.size() > 1) ask_waiting(now);
}

void AdmissionController::ask_waiting(TimePoint now) {
  measuring_ = false;
  for (const auto& [id, since] : queue_.waiting()) {
    Visit& visit = find_session(sessions_, id)->visit();
    if (now - since >= around_.options.policy.longest_wait) {
      queue_.leave(id);
      visit.fail(ErrorCode::server_full,
                 fmt::format("no place came free within {} minutes: try again later",
                             std::chrono::floor<std::chrono::minutes>(now - since).count()));
      continue;
    }
    const Room room = offer_for(visit.waiting_hello(), demands()).room;
    measuring_ = room == Room::unknown;
    if (measuring_ || (room == Room::no && now - since >= around_.options.policy.overtaken_at_most))
      return;
    if (room == Room::no) continue;
    // It leaves the queue, admitted or refused, or has to wait longer.
    turn_ = id;
    visit.ask_again(now);
    turn_.clear();
  }
}

void AdmissionController::admit_waiting(TimePoint now) {
  ask_waiting(now);
  queue_told_ = now;
  int position = 0;
  for (const auto& [id, since] : queue_.waiting())
    find_session(sessions_, id)->visit().say(queue_position(++position), now);
}

QueuePosition AdmissionController::queue_position(int position) const {
  return {position, measuring_ ? time_to_measure * position : queue_.estimate(position, admitted_)};
}

void AdmissionController::on_tick(TimePoint now) {
  budget_.set_cpus(machine_.cpus());
  grow_pictures();
  if (measuring_ || !queue_told_ || now - *queue_told_ >= speak_at_least_every) admit_waiting(now);
  const auto demanded = demands();
  const auto load = budget_.load(demanded);
  Metrics& metrics = around_.metrics;
  metrics.sessions.Set(admitted_);
  metrics.sessions_waiting.Set(static_cast<double>(queue_.size()));
  metrics.seats.Set(shut_ ? 0 : budget_.seats(demanded, around_.options.max_sessions));
  metrics.cpu_budget_used.Set(load.cpus);
  metrics.gpu_budget_used.Set(load.gpus);
}

}  // namespace catgs
