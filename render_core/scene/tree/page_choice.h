#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "render_core/scene/tree/cut.h"

namespace catgs {

/// Decides which pages of a tree are in memory, for all that look at it. Pages come and go by
/// family: the one or two pages that refine one node. A family is there only with the page above
/// it; the root's page stays. Pure: time comes in, decisions come out.
class PageChoice {
 public:
  /// `slots`: pages that fit into memory, at least least_slots.
  static constexpr std::uint32_t least_slots = 4;
  PageChoice(const TreeShape& shape, std::uint32_t slots);

  /// Begins a turn. Then note() each cut, and take the next() step.
  void begin(double now_s);
  void note(const Cut& cut);

  struct Step {
    std::vector<std::uint64_t> load;  // whole families, largest error first
    std::vector<std::uint64_t> drop;  // whole families
  };
  /// `free_slots`: those that may be written now. `held_slots`: those of dropped pages that a frame
  /// still needs. At most `most` pages are loaded, in whole families.
  Step next(std::uint32_t free_slots, std::uint32_t held_slots, std::uint32_t most);
  /// A page of the last step's `load` cannot be read, so its family is not in memory, and is not
  /// asked for again.
  void failed(std::uint64_t page);
  /// The first page of the family that a page belongs to.
  [[nodiscard]] std::uint64_t family_of(std::uint64_t page) const;

 private:
  struct Family {
    std::uint32_t families_below = 0;
    float error_px = 0.0f;  // of the node that it refines, when it was last wanted
    double wanted_at_s = 0.0;
  };
  struct Wanted {
    std::uint64_t first;  // page
    float error_px;
  };

  [[nodiscard]] std::uint32_t size_of_family(std::uint64_t first) const;
  /// The family of the page above; nothing above the families that the root's page holds.
  [[nodiscard]] Family* family_above(std::uint64_t first);
  [[nodiscard]] std::vector<Wanted> wanted_families() const;
  void add(const Wanted& wanted, std::vector<std::uint64_t>& pages);
  void drop_for(std::uint32_t pages, float error_px, std::vector<std::uint64_t>& dropped);
  void append(std::uint64_t first, std::vector<std::uint64_t>& pages) const;

  const TreeShape& shape_;
  std::uint32_t reserve_;  // slots that are kept free for the next turn
  double now_s_ = 0.0;
  std::unordered_map<std::uint64_t, Family> families_;  // in memory, by their first page
  std::unordered_map<std::uint64_t, float> wanted_;     // of this turn, by first page; error
  std::unordered_set<std::uint64_t> unreadable_;        // by first page
};

}  // namespace catgs
