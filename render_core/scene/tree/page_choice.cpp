#include "render_core/scene/tree/page_choice.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <tuple>

namespace catgs {
namespace {

/// A family in use makes way only for one whose node has a clearly larger error. Otherwise two
/// families of about the same error would replace each other again and again.
constexpr float clearly_less = 0.8f;

constexpr std::uint32_t slots_per_family = 2;

/// All families of a tree.
std::uint64_t families_of(const TreeShape& shape) {
  std::uint64_t sum = 0;
  for (int band = 0; band + 1 < shape.bands(); ++band)
    sum += shape.nodes_on(shape.top_level(band) + 1);
  return sum;
}

}  // namespace

PageChoice::PageChoice(std::uint32_t slots) : slots_(slots) { assert(slots >= least_slots); }

std::uint32_t PageChoice::slots_for(const TreeShape& shape) {
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(
      std::max<std::uint64_t>(least_slots, 1 + slots_per_family * families_of(shape)),
      std::numeric_limits<std::uint32_t>::max()));
}

bool PageChoice::add(std::uint32_t tree, const TreeShape& shape) {
  if (trees_.size() + 1 + slots_per_family > slots_) return false;
  return trees_.emplace(tree, &shape).second;
}

void PageChoice::remove(std::uint32_t tree) {
  trees_.erase(tree);
  std::erase_if(families_, [=](const auto& family) { return family.first.tree == tree; });
  std::erase_if(wanted_, [=](const auto& wanted) { return wanted.first.tree == tree; });
}

void PageChoice::begin(double now_s) {
  now_s_ = now_s;
  wanted_.clear();
}

void PageChoice::note(std::uint32_t tree, const Cut& cut) {
  for (const PageUse& use : cut.used) {
    const auto found = families_.find(family_of({tree, use.page}));
    if (found == families_.end()) continue;
    Family& family = found->second;
    const bool first = family.wanted_at_s != now_s_;
    family.error_px = first ? use.typical_px : std::max(family.error_px, use.typical_px);
    family.wanted_at_s = now_s_;
  }
  for (const PageUse& use : cut.missing) {
    const PageOfTree first = family_of({tree, use.page});
    if (families_.contains(first)) continue;
    float& error = wanted_[first];
    error = std::max(error, use.typical_px);
  }
}

/// Goes through the wishes, largest error first, and stops at the first that finds no room. So what
/// is loaded is never less wanted than what is left out.
PageChoice::Step PageChoice::next(std::uint32_t free_slots, std::uint32_t most) {
  Step step;
  std::int64_t room = capacity() - static_cast<std::int64_t>(families_.size());
  std::optional<Victims> going;
  const auto drop = [&](std::optional<float> below_px) {
    if (!going) going = victims();
    if (!drop_one(*going, below_px, step.drop)) return false;
    ++room;
    return true;
  };
  const auto within = [most](const std::vector<PageOfTree>& pages) {
    return pages.size() + slots_per_family <= most;
  };
  while (room < 0 && drop(std::nullopt)) {  // a new tree's root has taken a slot
  }
  for (const Wanted& wanted : wanted_families()) {
    // A family goes before the larger errors above it, unless the file is forged.
    const auto up = above(wanted.first);
    if (up && !families_.contains(*up)) continue;
    step.cut_short = !within(step.awaited) || (room <= 0 && !within(step.drop));
    if (step.cut_short) break;
    if (room <= 0 && !drop(clearly_less * wanted.error_px)) {
      step.budget_px = wanted.error_px;
      break;
    }
    if (up && !families_.contains(*up)) continue;  // it was dropped: a forged file
    --room;
    if (step.awaited.empty() && within(step.load) &&
        step.load.size() + slots_per_family <= free_slots)
      add_family(wanted, step.load);
    else
      append(wanted.first, step.awaited);
  }
  while (room < reserve() && within(step.drop) && drop(0.0f)) {
  }
  return step;
}

std::int64_t PageChoice::capacity() const {
  return (std::int64_t{slots_} - static_cast<std::int64_t>(trees_.size())) / slots_per_family;
}

std::int64_t PageChoice::reserve() const {
  std::int64_t all = 0;
  for (const auto& [tree, shape] : trees_) all += static_cast<std::int64_t>(families_of(*shape));
  return all <= capacity() ? 0 : std::clamp<std::int64_t>(capacity() / 8, 1, 32);
}

std::vector<PageChoice::Wanted> PageChoice::wanted_families() const {
  std::vector<Wanted> all;
  for (const auto& [first, error] : wanted_) all.push_back({first, error});
  std::ranges::sort(all, [](const Wanted& a, const Wanted& b) {
    return std::tie(b.error_px, a.first) < std::tie(a.error_px, b.first);
  });
  return all;
}

PageChoice::Victims PageChoice::victims() const {
  std::vector<Victim> all;
  for (const auto& [first, family] : families_)
    if (family.families_below == 0) all.push_back({family.wanted_at_s, family.error_px, first});
  return Victims(std::greater<>(), std::move(all));
}

void PageChoice::add_family(const Wanted& wanted, std::vector<PageOfTree>& pages) {
  families_[wanted.first] = {0, wanted.error_px, now_s_};
  if (const auto up = above(wanted.first)) ++families_.at(*up).families_below;
  append(wanted.first, pages);
}

bool PageChoice::drop_one(Victims& victims, std::optional<float> below_px,
                          std::vector<PageOfTree>& dropped) {
  if (victims.empty()) return false;
  const Victim victim = victims.top();
  const bool in_use = victim.wanted_at_s == now_s_;
  if (in_use && below_px && !(victim.error_px < *below_px)) return false;
  victims.pop();
  families_.erase(victim.first);
  append(victim.first, dropped);
  if (const auto up = above(victim.first)) {
    Family& family = families_.at(*up);
    if (--family.families_below == 0) victims.push({family.wanted_at_s, family.error_px, *up});
  }
  return true;
}

void PageChoice::failed(const PageOfTree& page) {
  const PageOfTree first = family_of(page);
  if (families_.erase(first) == 0) return;  // its other page cannot be read either
  if (const auto up = above(first)) --families_.at(*up).families_below;
}

PageOfTree PageChoice::family_of(const PageOfTree& page) const {
  return {page.tree, catgs::family_of(*trees_.at(page.tree), page.page)};
}

std::optional<PageOfTree> PageChoice::above(const PageOfTree& first) const {
  const TreeShape& shape = *trees_.at(first.tree);
  if (shape.root_of(first.page) == shape.root()) return std::nullopt;
  const PageOfTree up = family_of({first.tree, shape.page_of(refined_by(shape, first.page))});
  if (shape.root_of(up.page) == shape.root()) return std::nullopt;
  return up;
}

void PageChoice::append(const PageOfTree& first, std::vector<PageOfTree>& pages) const {
  const std::uint32_t size = family_size(*trees_.at(first.tree), first.page);
  for (std::uint32_t i = 0; i < size; ++i) pages.push_back({first.tree, first.page + i});
}

}  // namespace catgs
