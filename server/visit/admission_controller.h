#pragma once

#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "server/visit/admission_budget.h"
#include "server/visit/admission_queue.h"
#include "server/visit/machine_use.h"
#include "server/visit/session.h"

namespace catgs {

/// Admits clients, grants their pixels and keeps the queue of waiting clients, whom it tells
/// their positions. Session thread only.
class AdmissionController {
 public:
  /// All three arguments outlive it.
  AdmissionController(const VisitContext& around, const SessionList& sessions,
                      const MachineUse& machine);

  /// Returns the id of the scene that a hello may open. The client must support a codec of this
  /// server. Room is not checked.
  [[nodiscard]] std::variant<std::string, ErrorMessage> choose(const Hello& hello) const;
  AdmissionAnswer admit(Session& session, const Hello& hello);
  /// True: admit() would grant this hello at least half of the pixels that it asks for, and nobody
  /// would wait or give up pixels for it.
  [[nodiscard]] bool has_spare_slot(const Hello& hello) const;
  /// A client said hello. It may need less room than the clients that wait already.
  void on_newcomer(TimePoint now);
  /// The session takes no room any more and leaves the queue.
  void leave(Session& session, TimePoint now);
  /// Asks waiting clients that would find room now to try again. The others receive their
  /// position.
  void admit_waiting(TimePoint now);
  void on_tick(TimePoint now);
  /// No client is admitted any more.
  void shut() { shut_ = true; }
  [[nodiscard]] bool is_shut() const { return shut_; }
  [[nodiscard]] int admitted() const { return admitted_; }

 private:
  /// The offer that this hello would get beside `present`.
  [[nodiscard]] AdmissionBudget::Offer offer_for(const Hello& hello,
                                                 std::span<const SessionDemand> present) const;
  /// The admitted sessions. demands() has their measured demands in the same order.
  [[nodiscard]] std::vector<Session*> admitted_sessions() const;
  [[nodiscard]] std::vector<SessionDemand> demands() const;
  Admission let_in(Session& session, const Hello& hello, std::shared_ptr<const SceneEntry> scene,
                   const AdmissionBudget::Offer& offer);
  void set_pixel_share(Session& session, double share);
  /// Gives pixels back where there is room for them.
  void grow_pictures();
  void ask_waiting(TimePoint now);
  [[nodiscard]] QueuePosition queue_position(int position) const;

  const VisitContext& around_;
  const SessionList& sessions_;
  const MachineUse& machine_;
  AdmissionBudget budget_;
  AdmissionQueue queue_;
  int admitted_ = 0;
  bool shut_ = false;
  std::string turn_;        // id of the queued session that is being asked
  bool measuring_ = false;  // the head of the queue waits for measured costs
  std::optional<TimePoint> queue_told_;
};

}  // namespace catgs
