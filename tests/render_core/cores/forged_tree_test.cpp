// Trees whose checksums are right and whose content is not, drawn.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tests/render_core/cores/tree_views.h"
#include "tests/support/rendered.h"

namespace catgs::test {
namespace {

using ForgedTreeViews = CoreTest;

/// 20 leaves: the root's page has two levels, and three pages have leaves, the last one few.
struct ForgedTrees {
  static constexpr std::size_t gaussians = 20 * cluster_size - 10;
  explicit ForgedTrees(int sh_degree)
      : shape(gaussians, sh_degree),
        bytes(tree_bytes(random_cloud(gaussians, sh_degree, 41), pool)) {}

  using Forge = std::function<void(TreePage& page, std::uint64_t number)>;
  /// All pages, changed.
  [[nodiscard]] std::string with(const Forge& forge) const {
    std::string forged = bytes;
    for (std::uint64_t p = 0; p < shape.pages(); ++p)
      forged = with_page(std::move(forged), p, [&](TreePage& page) { forge(page, p); });
    return forged;
  }

  ThreadPool pool{2};
  TreeShape shape;
  std::string bytes;
};

/// True if the tree is drawn, false if it is refused. Pages that are refused alone are not drawn.
bool drawn_or_refused(std::string bytes) {
  RendererOptions options;
  options.kind = core;
  options.scene_memory = std::uint64_t{1} << 26;
  try {
    const auto tree = std::make_shared<TreeFile>(source_of(std::move(bytes)));
    const auto renderer = make_renderer(tree, options).renderer;
    for (const Pipeline pipeline : {Pipeline::exact, Pipeline::catgs}) {
      const auto view = renderer->make_view({.pipeline = pipeline});
      for (const auto& [distance, detail_px] :
           {std::pair(3.0f, 0.0f), {3.1f, 2.0f}, {60.0f, 0.0f}}) {
        const Rendered drawn = render_in(*view, tree_request(distance, detail_px));
        EXPECT_TRUE(
            std::ranges::all_of(drawn.rgb, [](float value) { return std::isfinite(value); }));
      }
    }
    return tree->damage().pages == 0;
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("a.tree"), std::string::npos) << error.what();
    return false;
  }
}

// A slot that the shape does not use must be empty.
TEST_F(ForgedTreeViews, UnusedSlotsThatClaimToBeUsedAreRefused) {
  for (const int degree : {1, 3}) {
    const ForgedTrees trees(degree);
    EXPECT_TRUE(drawn_or_refused(trees.bytes));
    const auto refused = [&](std::uint64_t page, std::size_t slot,
                             const std::function<void(NodeFacts&)>& forge) {
      const auto only = [&](TreePage& forged, std::uint64_t number) {
        if (number == page) forge(forged.facts(slot));
      };
      EXPECT_FALSE(drawn_or_refused(trees.with(only))) << "page " << page << " slot " << slot;
    };
    for (const std::uint64_t page : {std::uint64_t{0}, trees.shape.pages() - 1})
      for (const std::size_t slot : {trees.shape.slots() - 1, trees.shape.slots() - 2}) {
        refused(page, slot, [](NodeFacts& f) { f.count = cluster_size + 1; });
        refused(page, slot, [](NodeFacts& f) { f.count = 1'000'000; });
        refused(page, slot, [](NodeFacts& f) { f = {{1, {}}, {{}, {}, 1}, 1, cluster_size, {}}; });
        refused(page, slot, [](NodeFacts& f) { f.error = NAN; });
      }
  }
}

// The ends of each range that a page may use.
TEST_F(ForgedTreeViews, ExtremePagesAreDrawn) {
  const auto each_node = [](const TreeShape& shape, const auto& change) {
    return [&shape, change](TreePage& page, std::uint64_t number) {
      for_each_node_in(shape, number, [&](NodeId node) {
        const std::size_t slot = shape.slot_of(node);
        change(node, page.facts(slot), page.block(slot));
      });
    };
  };
  const auto words = [](std::span<std::byte> block, std::uint32_t count, std::uint32_t word) {
    for (std::uint32_t i = 0; i < count; ++i)
      for (std::uint32_t k = 0; k < 3; ++k)
        std::memcpy(&block[packed_offset(16, 16, i) + 4 * k], &word, 4);
  };
  for (const int degree : {1, 3}) {
    const ForgedTrees trees(degree);
    const auto drawn = [&](const char* what, const auto& change) {
      EXPECT_TRUE(drawn_or_refused(trees.with(each_node(trees.shape, change)))) << what;
    };
    drawn("errors", [](NodeId node, NodeFacts& f, auto) {
      if (node.level > 0) f.error = max_coordinate;
    });
    drawn("no errors", [](NodeId, NodeFacts& f, auto) { f.error = 0.0f; });
    drawn("bounds", [](NodeId, NodeFacts& f, auto) {
      f.bounds = {glm::vec3(0), glm::vec3(2.0f * max_coordinate), 64.0f * max_coordinate};
    });
    drawn("no reach", [](NodeId, NodeFacts& f, auto) { f.bounds.reach = 0.0f; });
    for (const float unit : {0x1p20f, 0x1p-63f})
      for (const std::uint32_t word : {0u, 0x3fffffffu, 0x7fffu, 0xffffffffu, 0x20004000u})
        drawn("covariances", [&](NodeId, NodeFacts& f, std::span<std::byte> block) {
          f.units.factor = unit;
          words(block, f.count, word);
        });
    drawn("harmonics", [](NodeId, NodeFacts& f, auto) {
      for (float& largest : f.units.sh) largest = 2.5e5f;
    });
  }
}

// Bytes changed at random, of those that are used more often.
TEST_F(ForgedTreeViews, RandomPagesAreDrawnOrRefused) {
  constexpr int rounds = 60;
  std::mt19937 random(7);
  const auto below = [&](std::size_t end) { return random() % end; };
  int drawn = 0;
  for (int round = 0; round < rounds; ++round) {
    static const ForgedTrees low(1), high(3);
    const ForgedTrees& trees = round % 2 == 0 ? low : high;
    const auto forge = [&](TreePage& page, std::uint64_t number) {
      if (below(2) == 0) return;
      std::vector<std::size_t> slots;
      for_each_node_in(trees.shape, number,
                       [&](NodeId n) { slots.push_back(trees.shape.slot_of(n)); });
      const std::size_t slot = slots[below(slots.size())];
      const std::span<std::byte> block = page.block(slot);
      const std::uint32_t count = page.facts(slot).count;
      for (std::size_t k = 0; k < 1 + below(500); ++k) {
        const auto record = static_cast<std::uint32_t>(below(count));
        const auto byte = static_cast<std::byte>(random());
        if (below(4) == 0)  // an opacity
          block[packed_offset(0, 16, record) + 12 + below(2)] = byte;
        else  // a factor
          block[packed_offset(16, 16, record) + below(12)] = byte;
      }
      if (below(8) == 0)
        page.bytes()[below(page.bytes().size())] = static_cast<std::byte>(random());
    };
    drawn += drawn_or_refused(trees.with(forge)) ? 1 : 0;
  }
  EXPECT_GT(drawn, rounds / 3);
  EXPECT_LT(drawn, rounds);
}

}  // namespace
}  // namespace catgs::test
