#include "server/session/spectator_hub.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/net/wire.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

// An IDR is many times the size of other frames, and the host pays for it too.
constexpr auto min_idr_interval = 1s;
constexpr auto speak_at_least_every = 750ms;

}  // namespace

void SpectatorHub::add(std::shared_ptr<Peer> peer, const ServerMessage& welcome) {
  peer->connection().send(wire::serialize(welcome));
  spectators_.push_back({std::move(peer), true});
}

void SpectatorHub::remove(const Peer& peer) {
  std::erase_if(spectators_, [&](const Spectator& s) { return s.peer.get() == &peer; });
}

void SpectatorHub::needs_idr(const Peer& peer) {
  for (Spectator& s : spectators_)
    if (s.peer.get() == &peer) s.waits_for_idr = true;
}

void SpectatorHub::send(const ServerMessage& message, TimePoint now) {
  if (spectators_.empty()) return;
  last_said_ = now;
  const OutgoingMessage outgoing = wire::serialize(message);
  for (Spectator& s : spectators_) s.peer->connection().send(outgoing);
}

void SpectatorHub::send(const OutgoingFrame& frame, TimePoint now) {
  const bool idr = frame.ticket.idr;
  if (idr) last_idr_ = now;
  if (spectators_.empty()) return;
  last_said_ = now;
  for (Spectator& s : spectators_) {
    if (s.waits_for_idr && !idr) continue;
    s.waits_for_idr = !s.peer->connection().send(frame).empty();
  }
}

bool SpectatorHub::wants_idr(TimePoint now) const {
  return now - last_idr_ >= min_idr_interval &&
         std::ranges::any_of(spectators_, &Spectator::waits_for_idr);
}

void SpectatorHub::keep_talking(TimePoint now) {
  if (now - last_said_ < speak_at_least_every) return;
  const auto since_epoch = now.time_since_epoch();
  send(Heartbeat{std::chrono::duration_cast<std::chrono::microseconds>(since_epoch).count()}, now);
}

void SpectatorHub::dismiss_all() {
  for (const Spectator& s : std::exchange(spectators_, {})) {
    s.peer->connection().send(wire::serialize(
        ErrorMessage{ErrorCode::session_ended, "the session that you watched has ended", true}));
    s.peer->dismiss(CloseCode::normal, "the session has ended");
  }
}

}  // namespace catgs
