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

/// The largest errors of a node over the cameras that may see it; negative: none does.
Errors visible_errors(std::span<const Eye> eyes, const NodeFacts& facts) {
  if (eyes.empty()) return {unbounded_px, unbounded_px};
  Errors largest;
  for (const Eye& eye : eyes) {
    if (eye.culler.outside(facts.bounds)) continue;
    largest.px = std::max(largest.px, eye.eye.error_px(facts.error, facts.bounds));
    largest.typical_px =
        std::max(largest.typical_px, eye.eye.typical_px(facts.error, facts.bounds));
  }
  return largest;
}

/// A node on the walk, and the part of it that its ancestors leave to it.
struct Step {
  NodeId node;
  float taken = 1.0f;
  float most_px = unbounded_px;  // the typical error of the node above
};

class Walk {
 public:
  Walk(const TreeShape& shape, std::span<const Camera> cameras, float detail_px,
       const FindPage& find)
      : shape_(shape), eyes_(cameras.begin(), cameras.end()), detail_px_(detail_px), find_(find) {}

  Cut run() {
    const std::uint64_t first = shape_.page_of(shape_.root());
    if (page_at(first).facts == nullptr) {
      cut_.missing.push_back({first, unbounded_px, unbounded_px});
      return std::move(cut_);
    }
    stack_.push_back({shape_.root()});
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
  /// Most steps stay in the page of the step before.
  PageInMemory page_at(std::uint64_t number) {
    if (number != last_number_) last_ = find_(number);
    last_number_ = number;
    return last_;
  }

  void visit(const Step& step) {
    const NodeFacts* facts = page_at(shape_.page_of(step.node)).facts;
    Errors errors = visible_errors(eyes_, facts[shape_.slot_of(step.node)]);
    if (errors.px < 0.0f) return;
    errors.typical_px = std::min(errors.typical_px, step.most_px);
    const float split = step.node.level == 0 ? 0.0f : split_into_children(step, errors);
    if (split < step.taken) cut_.drawn.push_back({step.node, step.taken - split});
  }

  /// The part of a node that its children take over. They are visited next.
  float split_into_children(const Step& step, const Errors& errors) {
    float split = std::min(step.taken, split_share(errors.px, detail_px_));
    if (split <= 0.0f) return 0.0f;
    const auto below = static_cast<std::uint8_t>(step.node.level - 1);
    const NodeId children[2] = {{below, 2 * step.node.index}, {below, 2 * step.node.index + 1}};
    const std::size_t count = children[1].index < shape_.nodes_on(below) ? 2 : 1;
    const std::uint64_t page = shape_.page_of(step.node);
    for (const NodeId& child : std::span(children).first(count)) {
      const std::uint64_t its_page = shape_.page_of(child);
      if (its_page == page) continue;
      const PageInMemory found = find_(its_page);
      (found.facts != nullptr ? cut_.used : cut_.missing)
          .push_back({its_page, errors.typical_px, errors.px});
      split = found.facts != nullptr ? std::min(split, found.shown) : 0.0f;
    }
    if (split > 0.0f)
      for (std::size_t i = count; i-- > 0;)
        stack_.push_back({children[i], split, errors.typical_px});
    return split;
  }

  const TreeShape& shape_;
  const std::vector<Eye> eyes_;
  const float detail_px_;
  const FindPage& find_;
  std::uint64_t last_number_ = ~std::uint64_t{0};
  PageInMemory last_;
  std::vector<Step> stack_;
  Cut cut_;
};

}  // namespace

Cut choose_cut(const TreeShape& shape, std::span<const Camera> cameras, float detail_px,
               const FindPage& find) {
  return Walk(shape, cameras, detail_px, find).run();
}

}  // namespace catgs
