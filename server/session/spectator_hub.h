#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "server/session/peer.h"

namespace catgs {

/// Those who look on at one session. They get its frames as they were encoded for its host, who
/// never waits for them: one that reads too slowly misses frames up to the next IDR. Not
/// thread-safe.
class SpectatorHub {
 public:
  explicit SpectatorHub(int limit) : limit_(static_cast<std::size_t>(limit)) {}

  [[nodiscard]] bool full() const { return spectators_.size() >= limit_; }
  [[nodiscard]] std::size_t size() const { return spectators_.size(); }

  /// `welcome` is what the spectator hears first; frames follow from the next IDR on.
  void add(std::shared_ptr<Peer> peer, const ServerMessage& welcome);
  void remove(const Peer& peer);
  /// Its decoder has lost the thread.
  void needs_idr(const Peer& peer);

  void send(const ServerMessage& message, TimePoint now);
  void send(const OutgoingFrame& frame, TimePoint now);
  /// At least four times a second. True: somebody waits for an IDR, and the last one was sent a
  /// second ago or more.
  [[nodiscard]] bool wants_idr(TimePoint now) const;
  /// Says something when nothing was said for almost a second.
  void keep_talking(TimePoint now);
  /// The session has ended.
  void dismiss_all();

 private:
  struct Spectator {
    std::shared_ptr<Peer> peer;
    bool waits_for_idr = true;
  };

  const std::size_t limit_;
  std::vector<Spectator> spectators_;
  TimePoint last_idr_{};
  TimePoint last_said_{};
};

}  // namespace catgs
