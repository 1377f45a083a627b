#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <vector>

#include "render_core/math/camera.h"
#include "render_core/scene/tree/cut.h"

namespace catgs {

/// The cameras and the detail of a View.
struct ViewDemand {
  std::vector<Camera> cameras;  // now, and where it may be soon
  float detail_px = 0.0f;
  bool at_once = false;  // pages that come are shown at once, not blended in

  bool operator==(const ViewDemand& other) const;
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
  void look(ViewDemand demand);
  /// The demand, and its number.
  struct Numbered {
    ViewDemand demand;
    std::uint64_t number = 0;
  };
  [[nodiscard]] Numbered demand() const;
  /// A turn of the pool has looked at the demand with this number. `cut`: as it was before the
  /// turn. `budget_px`: no page up to this typical error finds room, so the View does without.
  /// `changes`: pages of the cut came or went in the turn, or will in the next ones.
  void turned(std::uint64_t number, const Cut& cut, float budget_px, bool changes, double now_s);
  /// Whether the next frame for the same demand may look better than one at `now_s`, in the pool's
  /// time: pages are still being read or blended in.
  [[nodiscard]] bool waits(double now_s) const;
  struct Progress {
    std::uint64_t changes = 0;  // turns that began or continued a change of its cuts
    std::uint32_t missing = 0;  // pages within the budget that were not resident at the last turn
    float coarsest_px = 0.0f;   // the largest error over the wanted detail: memory has no finer one
  };
  [[nodiscard]] Progress progress() const;

 private:
  const std::function<void()> wake_;
  mutable std::mutex mutex_;  // guards the rest
  ViewDemand demand_;
  std::uint64_t number_ = 0, turned_ = 0;  // of demand_, and of the last one that was looked at
  bool changing_ = false;
  double blends_until_s_ = 0.0;
  Progress progress_;
};

}  // namespace catgs
