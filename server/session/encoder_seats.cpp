#include "server/session/encoder_seats.h"

#include <algorithm>

namespace catgs {
namespace {

constexpr std::chrono::seconds learnt_holds{60};

}  // namespace

EncoderSeats::Seat::~Seat() {
  const std::lock_guard lock(of_->mutex_);
  --of_->kinds_[kind_].taken;
}

bool EncoderSeats::has_room(const Kind& kind, TimePoint now) {
  if (kind.told && kind.taken >= *kind.told) return false;
  const bool known = kind.learnt && now - kind.learnt_at < learnt_holds;
  return !known || kind.taken < *kind.learnt;
}

void EncoderSeats::set_limit(EncoderKind kind, int limit) {
  const std::lock_guard lock(mutex_);
  kinds_[kind].told = limit;
}

std::shared_ptr<const EncoderSeats::Seat> EncoderSeats::take(EncoderKind kind, TimePoint now) {
  const std::lock_guard lock(mutex_);
  Kind& of_kind = kinds_[kind];
  if (!has_room(of_kind, now)) return nullptr;
  auto seat = std::make_shared<const Seat>(shared_from_this(), kind);
  ++of_kind.taken;
  return seat;
}

void EncoderSeats::refused(const Seat& seat, TimePoint now) {
  const std::lock_guard lock(mutex_);
  Kind& kind = kinds_[seat.kind()];
  kind.learnt = kind.taken - 1;
  kind.learnt_at = now;
}

std::map<EncoderKind, int> EncoderSeats::taken() const {
  const std::lock_guard lock(mutex_);
  std::map<EncoderKind, int> taken;
  for (const auto& [kind, seats] : kinds_) taken.emplace(kind, seats.taken);
  return taken;
}

}  // namespace catgs
