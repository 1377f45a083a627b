#include "server/visit/visit_life.h"

#include <cassert>

#include <fmt/format.h>

namespace catgs {

void VisitLife::resume(TimePoint now) {
  assert(resumable());
  lost_at_.reset();
  paused_ = false;
  note_activity(now);
}

std::optional<ErrorMessage> VisitLife::idle_message(TimePoint now) {
  using namespace std::chrono_literals;
  if (policy_.idle_timeout <= 0ms) return std::nullopt;
  const auto left = last_activity_ + policy_.idle_timeout - now;
  if (left <= 0ms)
    return ErrorMessage{ErrorCode::idle_timeout, "nothing has moved for a long time", true};
  if (idle_warned_ || left > policy_.idle_warning) return std::nullopt;
  idle_warned_ = true;
  const auto seconds = std::chrono::ceil<std::chrono::seconds>(left).count();
  return ErrorMessage{
      ErrorCode::idle_timeout,
      fmt::format("nothing moves: move the camera to keep this session, which ends in {} s "
                  "otherwise",
                  seconds),
      false};
}

}  // namespace catgs
