#include "render_core/scene/tree/page_choice.h"

#include <algorithm>
#include <cassert>
#include <tuple>

namespace catgs {
namespace {

/// A family in use makes way only for one whose node has a clearly larger error. Otherwise two
/// families of about the same error would replace each other again and again.
constexpr float clearly_less = 0.8f;

}  // namespace

PageChoice::PageChoice(const TreeShape& shape, std::uint32_t slots)
    : shape_(shape),
      reserve_(shape.pages() <= slots ? 0 : std::clamp<std::uint32_t>(slots / 8, 2, 64)) {
  assert(slots >= least_slots);
}

void PageChoice::begin(double now_s) {
  now_s_ = now_s;
  wanted_.clear();
}

void PageChoice::note(const Cut& cut) {
  for (const PageUse& use : cut.used) {
    const auto found = families_.find(family_of(use.page));
    if (found == families_.end()) continue;
    Family& family = found->second;
    const bool first = family.wanted_at_s != now_s_;
    family.error_px = first ? use.error_px : std::max(family.error_px, use.error_px);
    family.wanted_at_s = now_s_;
  }
  for (const PageUse& use : cut.missing) {
    const std::uint64_t first = family_of(use.page);
    if (unreadable_.contains(first) || families_.contains(first)) continue;
    float& error = wanted_[first];
    error = std::max(error, use.error_px);
  }
}

PageChoice::Step PageChoice::next(std::uint32_t free_slots, std::uint32_t held_slots,
                                  std::uint32_t most) {
  Step step;
  std::uint32_t left_out = 0;  // pages
  float left_out_error = 0.0f;
  const std::uint32_t room = std::min(free_slots, most);
  for (const Wanted& wanted : wanted_families()) {
    const std::uint32_t size = size_of_family(wanted.first);
    if (left_out == 0 && step.load.size() + size <= room) {
      add(wanted, step.load);
      continue;
    }
    left_out_error = std::max(left_out_error, wanted.error_px);
    left_out += size;
    if (left_out >= most) break;
  }
  const auto free_then = free_slots + held_slots - static_cast<std::uint32_t>(step.load.size());
  const std::uint32_t goal = reserve_ + (reserve_ > 0 ? std::min(left_out, most) : 0);
  if (free_then < goal) drop_for(goal - free_then, left_out_error, step.drop);
  return step;
}

std::vector<PageChoice::Wanted> PageChoice::wanted_families() const {
  std::vector<Wanted> all;
  for (const auto& [first, error] : wanted_) all.push_back({first, error});
  std::ranges::sort(all, [](const Wanted& a, const Wanted& b) {
    return std::tie(b.error_px, a.first) < std::tie(a.error_px, b.first);
  });
  return all;
}

void PageChoice::add(const Wanted& wanted, std::vector<std::uint64_t>& pages) {
  families_[wanted.first] = {0, wanted.error_px, now_s_};
  if (Family* above = family_above(wanted.first)) ++above->families_below;
  append(wanted.first, pages);
}

/// Drops families without families below them: those longest unused first, then those in use with
/// errors clearly under `error_px`, smallest first.
void PageChoice::drop_for(std::uint32_t pages, float error_px,
                          std::vector<std::uint64_t>& dropped) {
  struct Candidate {
    double wanted_at_s;
    float error_px;
    std::uint64_t first;
  };
  std::vector<Candidate> candidates;
  for (const auto& [first, family] : families_) {
    const bool in_use = family.wanted_at_s == now_s_;
    if (family.families_below > 0 || (in_use && family.error_px >= clearly_less * error_px))
      continue;
    candidates.push_back({family.wanted_at_s, family.error_px, first});
  }
  std::ranges::sort(candidates, [](const Candidate& a, const Candidate& b) {
    return std::tie(a.wanted_at_s, a.error_px, a.first) <
           std::tie(b.wanted_at_s, b.error_px, b.first);
  });
  for (const Candidate& candidate : candidates) {
    if (dropped.size() >= pages) break;
    if (Family* above = family_above(candidate.first)) --above->families_below;
    families_.erase(candidate.first);
    append(candidate.first, dropped);
  }
}

void PageChoice::failed(std::uint64_t page) {
  const std::uint64_t first = family_of(page);
  if (!unreadable_.insert(first).second) return;
  if (Family* above = family_above(first)) --above->families_below;
  families_.erase(first);
}

std::uint64_t PageChoice::family_of(std::uint64_t page) const {
  const NodeId root = shape_.root_of(page);
  return root.index % 2 == 1 ? page - 1 : page;
}

std::uint32_t PageChoice::size_of_family(std::uint64_t first) const {
  const NodeId root = shape_.root_of(first);
  return root.index + 1 < shape_.nodes_on(root.level) ? 2 : 1;
}

PageChoice::Family* PageChoice::family_above(std::uint64_t first) {
  const NodeId root = shape_.root_of(first);
  if (root == shape_.root()) return nullptr;
  const NodeId above{static_cast<std::uint8_t>(root.level + 1), root.index / 2};
  const auto found = families_.find(family_of(shape_.page_of(above)));
  return found == families_.end() ? nullptr : &found->second;
}

void PageChoice::append(std::uint64_t first, std::vector<std::uint64_t>& pages) const {
  for (std::uint32_t i = 0; i < size_of_family(first); ++i) pages.push_back(first + i);
}

}  // namespace catgs
