#include "render_core/scene/tree/cut.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include "render_core/scene/clusters.h"

namespace catgs {
namespace {

constexpr float unbounded_px = std::numeric_limits<float>::infinity();

struct Eye {
  explicit Eye(const Camera& camera) : culler(camera), eye(camera) {}

  ClusterCuller culler;
  CutEye eye;
};

/// A node's errors, as PageUse has them.
struct Errors {
  float px = -1.0f, typical_px = -1.0f;
};

/// A node on the walk, and the part of it that its ancestors leave to it.
struct Step {
  NodeId node;
  PageInMemory page;  // of the node
  float taken = 1.0f;
  float most_px = unbounded_px;  // the typical error of the node above
  bool within = false;           // the node above is within all views
};

class Walk {
 public:
  Walk(const TreeShape& shape, std::span<const Camera> cameras, float detail_px,
       const FindPage& find, const CutParts& parts)
      : shape_(shape),
        eyes_(cameras.begin(), cameras.end()),
        detail_px_(detail_px),
        find_(find),
        parts_(parts),
        draws_(parts.part != CutParts::Part::pages),
        pages_(parts.part != CutParts::Part::drawn) {}

  Cut run() {
    const std::uint64_t first = shape_.page_of(shape_.root());
    const PageInMemory page = find_(first);
    if (page.facts == nullptr) {
      cut_.missing.push_back({first, unbounded_px, unbounded_px});
      return std::move(cut_);
    }
    stack_.push_back({shape_.root(), page});
    while (!stack_.empty()) {
      const Step step = stack_.back();
      stack_.pop_back();
      visit(step);
    }
    std::ranges::sort(cut_.missing, [](const PageUse& a, const PageUse& b) {
      return std::tie(b.error_px, a.page) < std::tie(a.error_px, b.page);
    });
    return std::move(cut_);
  }

 private:
  void visit(Step step) {
    const NodeFacts& facts = step.page.facts[shape_.slot_of(step.node)];
    Errors errors = visible_errors(facts, step.within);
    if (errors.px < 0.0f) return;
    errors.typical_px = std::min(errors.typical_px, step.most_px);
    const bool leaf = step.node.level == 0;
    // Leaves are asked about when they are drawn, by their own bounds.
    if (!leaf && parts_.hides && parts_.hides(facts.bounds)) return;
    const float split = leaf ? 0.0f : split_into_children(step, errors);
    if (!draws_ || split >= step.taken) return;
    cut_.drawn.push_back({step.node, step.taken - split});
    cut_.slots.push_back(step.page.slot);
  }

  /// The largest errors of a node over the cameras that may see it; negative: none does. `within`:
  /// on entry whether the node above is within all views, then whether the node is.
  Errors visible_errors(const NodeFacts& facts, bool& within) const {
    if (eyes_.empty()) return {unbounded_px, unbounded_px};
    const bool known = within;
    within = true;
    Errors largest;
    for (const Eye& eye : eyes_) {
      if (!known && eye.culler.outside(facts.bounds)) {
        within = false;
        continue;
      }
      within = within && (known || eye.culler.within(facts.bounds));
      largest.px = std::max(largest.px, eye.eye.error_px(facts.error, facts.bounds));
      if (pages_)
        largest.typical_px =
            std::max(largest.typical_px, eye.eye.typical_px(facts.error, facts.bounds));
    }
    return largest;
  }

  /// The part of a node that its children take over. They are visited next.
  float split_into_children(const Step& step, const Errors& errors) {
    float split = std::min(step.taken, split_share(errors.px, detail_px_));
    if (split <= 0.0f) return 0.0f;
    const auto below = static_cast<std::uint8_t>(step.node.level - 1);
    Step children[2] = {{{below, 2 * step.node.index}, step.page},
                        {{below, 2 * step.node.index + 1}, step.page}};
    const std::size_t count = children[1].node.index < shape_.nodes_on(below) ? 2 : 1;
    const bool ends_page = step.node.level % shape_.page_levels() == 0;
    for (Step& child : std::span(children).first(ends_page ? count : 0)) {
      const std::uint64_t its_page = shape_.page_of(child.node);
      child.page = find_(its_page);
      const bool there = child.page.facts != nullptr;
      if (pages_)
        (there ? cut_.used : cut_.missing).push_back({its_page, errors.typical_px, errors.px});
      split = there ? std::min(split, child.page.shown) : 0.0f;
    }
    const bool goes_on = draws_ || step.node.level > shape_.page_levels();
    if (split > 0.0f && goes_on)
      for (std::size_t i = count; i-- > 0;) {
        Step& child = children[i];
        child.taken = split;
        child.most_px = errors.typical_px;
        child.within = step.within;
        __builtin_prefetch(&child.page.facts[shape_.slot_of(child.node)]);
        stack_.push_back(child);
      }
    return split;
  }

  const TreeShape& shape_;
  const std::vector<Eye> eyes_;
  const float detail_px_;
  const FindPage& find_;
  const CutParts& parts_;
  const bool draws_, pages_;
  std::vector<Step> stack_;
  Cut cut_;
};

}  // namespace

Cut choose_cut(const TreeShape& shape, std::span<const Camera> cameras, float detail_px,
               const FindPage& find, const CutParts& parts) {
  return Walk(shape, cameras, detail_px, find, parts).run();
}

}  // namespace catgs
