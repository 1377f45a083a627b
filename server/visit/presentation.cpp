#include "server/visit/presentation.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/net/wire.h"

namespace catgs {
namespace {

// Enough for a smooth way between two of them. Followers draw at their own rate.
constexpr std::chrono::milliseconds between_cameras{33};

bool same_but_for_camera(const Lead& a, const Lead& b) {
  return a.state == b.state && a.name == b.name && a.company == b.company;
}

}  // namespace

void Presentation::begin(std::string name, TimePoint now) {
  if (!since_) since_ = now;
  name_ = std::move(name);
}

void Presentation::end() {
  if (!std::exchange(since_, {})) return;
  tell({LeadState::ended, name_, 0, {}});
  followers_.clear();
  told_.reset();
  camera_.reset();
}

void Presentation::add(const std::shared_ptr<ClientConnection>& follower) {
  remove(*follower);
  followers_.push_back(follower);
  Lead now = told_.value_or(Lead{LeadState::leads, name_, followers_.size(), {}});
  now.camera = camera_;
  follower->connection().send(wire::serialize(now));
}

void Presentation::remove(const ClientConnection& follower) {
  std::erase_if(followers_, [&](const auto& known) {
    const auto connection = known.lock();
    return !connection || connection.get() == &follower;
  });
}

std::size_t Presentation::followers() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(followers_, [](const auto& follower) { return !follower.expired(); }));
}

void Presentation::moved(const PoseSample& camera, TimePoint now) {
  const bool stops = camera.at_rest && !(camera_ && camera_->at_rest);
  camera_ = camera;
  camera_is_new_ = true;
  if (!camera_told_ || stops || now - *camera_told_ >= between_cameras) tell_camera(now);
}

std::optional<Lead> Presentation::news(std::size_t spectators, bool away, TimePoint now) {
  if (!since_) return std::nullopt;
  Lead lead{away ? LeadState::away : LeadState::leads, name_, spectators + followers(), {}};
  if (told_ && same_but_for_camera(*told_, lead)) {
    if (camera_is_new_) tell_camera(now);
    return std::nullopt;
  }
  told_ = lead;
  tell_camera(now);
  return lead;
}

void Presentation::tell(const Lead& lead) const {
  const OutgoingMessage message = wire::serialize(lead);
  for (const auto& known : followers_)
    if (const auto follower = known.lock()) follower->connection().send(message);
}

void Presentation::tell_camera(TimePoint now) {
  camera_told_ = now;
  camera_is_new_ = false;
  if (!since_ || followers_.empty()) return;
  Lead lead = told_.value_or(Lead{LeadState::leads, name_, followers(), {}});
  lead.camera = camera_;
  tell(lead);
}

}  // namespace catgs
