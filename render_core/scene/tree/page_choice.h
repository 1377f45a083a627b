#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <queue>
#include <unordered_map>
#include <vector>

#include "render_core/scene/tree/cut.h"

namespace catgs {

/// A page of one of several trees.
struct PageOfTree {
  std::uint32_t tree = 0;
  std::uint64_t page = 0;

  auto operator<=>(const PageOfTree&) const = default;
};

/// Decides which pages of several trees are in memory, for all that look at them. Pages come and go
/// by family: the one or two pages that refine one node. A family is there only with the page above
/// it; the page of a tree's root stays. The largest typical errors on screen win, whichever tree
/// they are of. Pure: time comes in, decisions come out.
///
/// A family counts for two slots even where it has one page. So any family fits where another was,
/// and while nobody's wishes change, none that went comes back.
class PageChoice {
 public:
  static constexpr std::uint32_t least_slots = 4;
  /// `slots`: pages that fit into memory, at least least_slots.
  explicit PageChoice(std::uint32_t slots);

  /// The slots for all pages of a tree.
  [[nodiscard]] static std::uint32_t slots_for(const TreeShape& shape);

  /// The page of the root of a new tree takes a slot from now on. `shape` must live until
  /// remove(). False: there are too many trees.
  [[nodiscard]] bool add(std::uint32_t tree, const TreeShape& shape);
  void remove(std::uint32_t tree);

  /// Begins a turn. Then note() each cut, and take the next() step.
  void begin(double now_s);
  void note(std::uint32_t tree, const Cut& cut);

  struct Step {
    std::vector<PageOfTree> load;     // whole families, largest error first
    std::vector<PageOfTree> drop;     // whole families
    std::vector<PageOfTree> awaited;  // whole families to be loaded when more slots are free
    bool cut_short = false;           // more would have changed without the bound
    float budget_px = 0.0f;  // no family up to this error finds room: cuts are as coarse as that
  };
  /// `free_slots`: those that may be written now. Fewer than there should be are free while frames
  /// still need pages that were dropped. At most `most` pages are loaded, and as many dropped.
  [[nodiscard]] Step next(std::uint32_t free_slots, std::uint32_t most);
  /// A page of the last step's `load` cannot be read, so its family is not in memory. Cuts that are
  /// noted from now on must not miss it.
  void failed(const PageOfTree& page);

 private:
  struct Family {
    std::uint32_t families_below = 0;
    float error_px = 0.0f;  // of the node that it refines, when it was last wanted
    double wanted_at_s = 0.0;
  };
  struct Wanted {
    PageOfTree first;
    float error_px;
  };
  /// A family that may go. Those longest unused come first, then those in use, by error.
  struct Victim {
    double wanted_at_s;
    float error_px;
    PageOfTree first;

    auto operator<=>(const Victim&) const = default;
  };
  using Victims = std::priority_queue<Victim, std::vector<Victim>, std::greater<>>;
  struct Hash {
    std::size_t operator()(const PageOfTree& of) const {
      return std::hash<std::uint64_t>()(std::uint64_t{of.tree} << 40 ^ of.page);
    }
  };

  [[nodiscard]] PageOfTree family_of(const PageOfTree& page) const;
  /// The first page of the family of the page above; nothing above the families that the root's
  /// page holds.
  [[nodiscard]] std::optional<PageOfTree> above(const PageOfTree& first) const;
  /// Families that fit into memory.
  [[nodiscard]] std::int64_t capacity() const;
  /// Families that are kept free, so that a camera that moves finds room at once.
  [[nodiscard]] std::int64_t reserve() const;
  [[nodiscard]] std::vector<Wanted> wanted_families() const;
  [[nodiscard]] Victims victims() const;
  void add_family(const Wanted& wanted, std::vector<PageOfTree>& pages);
  /// Drops the first victim. Of those in use, only one with an error under `below_px`; no bound:
  /// any. Returns whether one was dropped.
  bool drop_one(Victims& victims, std::optional<float> below_px, std::vector<PageOfTree>& dropped);
  void append(const PageOfTree& first, std::vector<PageOfTree>& pages) const;

  std::uint32_t slots_;
  double now_s_ = 0.0;
  std::map<std::uint32_t, const TreeShape*> trees_;
  std::unordered_map<PageOfTree, Family, Hash> families_;  // in memory, by their first page
  std::unordered_map<PageOfTree, float, Hash> wanted_;     // of this turn, by first page; error
};

}  // namespace catgs
