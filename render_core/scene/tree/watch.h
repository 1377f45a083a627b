#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <vector>

#include "render_core/math/camera.h"
#include "render_core/scene/tree/cut.h"

namespace catgs {

/// The cameras and the detail of a View.
struct Lookout {
  std::vector<Camera> cameras;  // now, and where it may be soon
  float detail_px = 0.0f;
  bool at_once = false;  // pages that come are shown at once, not blended in

  bool operator==(const Lookout& other) const;
};

/// The link between a View and the pool of pages. Its functions may be called from any thread.
class Watch {
 public:
  /// `wake`: called after each look() elsewhere, and at the end.
  explicit Watch(std::function<void()> wake) : wake_(std::move(wake)) {}
  ~Watch() { wake_(); }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  /// Says what the View draws now.
  void look(Lookout lookout);
  /// The lookout, and its number.
  struct Numbered {
    Lookout lookout;
    std::uint64_t number = 0;
  };
  [[nodiscard]] Numbered lookout() const;
  /// A turn of the pool has looked at the lookout with this number. `cut`: as it was before the
  /// turn. `changes`: pages of the cut came or went in the turn, or will in the next ones.
  void turned(std::uint64_t number, const Cut& cut, bool changes, double now_s);
  /// Whether the next frame for the same lookout may look better than one at `now_s`, in the pool's
  /// time: pages are still being read or blended in.
  [[nodiscard]] bool waits(double now_s) const;
  struct Progress {
    std::uint64_t changes = 0;  // turns that began or continued a change of its cuts
    std::uint32_t missing = 0;  // pages that were wanted but not resident at the last turn
    float coarsest_px = 0.0f;   // the largest error that missing pages cause
  };
  [[nodiscard]] Progress progress() const;

 private:
  const std::function<void()> wake_;
  mutable std::mutex mutex_;  // guards the rest
  Lookout lookout_;
  std::uint64_t number_ = 0, turned_ = 0;  // of lookout_, and of the last one that was looked at
  bool changing_ = false;
  double blends_until_s_ = 0.0;
  Progress progress_;
};

}  // namespace catgs
