#include "server/visit/shared_tour.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/net/wire.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

// Enough for a smooth way between two of them. Followers draw at their own rate.
constexpr auto between_cameras = 33ms;
constexpr auto between_positions = 500ms;
// A quarter of their lifetime: a slow connection may drop a Lead for a newer one.
constexpr auto between_passes = 1h;
// From all participants. Each may send two a second (Session).
constexpr double pings_per_second = 10.0;

bool same_but_for_camera(const Lead& a, const Lead& b) {
  return a.state == b.state && a.name == b.name && a.participants == b.participants &&
         a.may_ping == b.may_ping && a.shown == b.shown;
}

}  // namespace

void SharedTour::begin(const Present& settings, TimePoint now) {
  if (!since_) {
    since_ = passes_renewed_ = now;
    pings_.emplace(pings_per_second, pings_per_second, now);
  }
  settings_ = settings;
}

void SharedTour::end(bool elsewhere) {
  if (!std::exchange(since_, {})) return;
  tell_followers(Lead{
      .state = LeadState::ended, .name = settings_.name, .camera = {}, .elsewhere = elsewhere});
  followers_.clear();
  told_.reset();
  camera_.reset();
  positions_told_ = {};
}

void SharedTour::add(const std::shared_ptr<ClientConnection>& follower) {
  remove(*follower);
  followers_.push_back(follower);
  Lead now = told_.value_or(lead(LeadState::leads, followers_.size()));
  now.camera = camera_;
  follower->connection().send(wire::serialize(now));
  if (!positions_told_.positions.empty())
    follower->connection().send(wire::serialize(positions_told_));
}

void SharedTour::remove(const ClientConnection& follower) {
  std::erase_if(followers_, [&](const auto& known) {
    const auto connection = known.lock();
    return !connection || connection.get() == &follower;
  });
}

std::size_t SharedTour::followers() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(followers_, [](const auto& follower) { return !follower.expired(); }));
}

bool SharedTour::has(const ClientConnection& follower) const {
  return std::ranges::any_of(followers_,
                             [&](const auto& known) { return known.lock().get() == &follower; });
}

void SharedTour::moved(const PoseSample& camera, TimePoint now) {
  const bool stops = camera.at_rest && !(camera_ && camera_->at_rest);
  camera_ = camera;
  camera_is_new_ = true;
  // A stop may come one interval early, so that followers stop, too. The next camera is then later.
  if (now >= next_camera_ - (stops ? between_cameras : 0ms)) tell_camera(now);
}

std::optional<Lead> SharedTour::news(std::size_t spectators, bool away, TimePoint now,
                                     const std::function<std::string()>& scene_pass) {
  if (!since_) return std::nullopt;
  Lead now_told = lead(away ? LeadState::away : LeadState::leads, spectators + followers());
  const bool renews_passes = now - passes_renewed_ >= between_passes;
  if (told_ && same_but_for_camera(*told_, now_told) && !renews_passes) {
    if (camera_is_new_) tell_camera(now);
    return std::nullopt;
  }
  told_ = now_told;
  tell_camera(now);
  if (renews_passes) {
    passes_renewed_ = now;
    now_told.scene_pass = scene_pass();
  }
  return now_told;
}

bool SharedTour::ping(const Pinged& pinged, TimePoint now) {
  if (!since_ || !(pinged.by_leader || settings_.pings) || !pings_->take(now)) return false;
  tell_followers(pinged);
  return true;
}

bool SharedTour::tell(const Participants& participants, TimePoint now) {
  if (participants == positions_told_) return false;
  if (positions_told_at_ && now - *positions_told_at_ < between_positions) return false;
  positions_told_ = participants;
  positions_told_at_ = now;
  tell_followers(participants);
  return true;
}

Lead SharedTour::lead(LeadState state, std::size_t participants) const {
  return {.state = state,
          .name = settings_.name,
          .participants = participants,
          .camera = {},
          .may_ping = settings_.pings,
          .shown = shown_};
}

void SharedTour::tell_followers(const ServerMessage& message) const {
  const OutgoingMessage outgoing = wire::serialize(message);
  for (const auto& known : followers_)
    if (const auto follower = known.lock()) follower->connection().send(outgoing);
}

void SharedTour::tell_camera(TimePoint now) {
  next_camera_ = std::max(next_camera_, now) + between_cameras;
  camera_is_new_ = false;
  if (!since_ || followers_.empty()) return;
  Lead told = told_.value_or(lead(LeadState::leads, followers()));
  told.camera = camera_;
  tell_followers(told);
}

}  // namespace catgs
