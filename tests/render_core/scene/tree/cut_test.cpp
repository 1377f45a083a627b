#include "render_core/scene/tree/cut.h"

#include <algorithm>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/scene/tree/tree_file.h"
#include "tests/render_core/scene/tree/tree_test_support.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {
namespace {

/// A tree in memory of which some pages are resident.
class SomePages {
 public:
  SomePages(std::size_t gaussians, int degree, std::uint64_t seed)
      : file_(source_of(tree_bytes(random_cloud(gaussians, degree, seed), pool_))),
        resident_(file_.shape().pages(), true),
        shown_(file_.shape().pages(), 1.0f) {
    for (std::uint64_t p = 0; p < file_.shape().pages(); ++p) pages_.push_back(file_.page(p));
  }

  [[nodiscard]] const TreeShape& shape() const { return file_.shape(); }
  [[nodiscard]] const NodeFacts& facts(NodeId node) const {
    return pages_[shape().page_of(node)]->facts(shape().slot_of(node));
  }
  [[nodiscard]] bool resident(NodeId node) const { return resident_[shape().page_of(node)]; }
  [[nodiscard]] float shown(NodeId node) const { return shown_[shape().page_of(node)]; }
  /// Some pages are being blended in: those that refine one node alike, and none before the page
  /// above.
  void blend_some(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    for (std::uint64_t p = 1; p < shown_.size(); ++p) {
      const bool second = shape().root_of(p).index % 2 == 1;
      shown_[p] = second ? shown_[p - 1]
                         : shown(refined_by(shape(), p)) *
                               std::uniform_real_distribution<float>(0, 1)(random);
    }
  }
  void keep_some(std::uint64_t seed, double share) {
    std::mt19937_64 random(seed);
    for (std::size_t p = 1; p < resident_.size(); ++p)
      resident_[p] = std::bernoulli_distribution(share)(random);
  }
  [[nodiscard]] Cut cut(std::span<const Camera> cameras, float detail_px,
                        const CutParts& parts = {}) const {
    const auto in_memory = [&](std::uint64_t page) -> PageInMemory {
      return {resident_[page] ? &pages_[page]->facts(0) : nullptr, shown_[page],
              static_cast<std::uint32_t>(3 * page)};
    };
    return choose_cut(shape(), cameras, detail_px, in_memory, parts);
  }
  void drop(std::uint64_t page) { resident_[page] = false; }

 private:
  ThreadPool pool_{2};
  TreeFile file_;
  std::vector<std::unique_ptr<const TreePage>> pages_;
  std::vector<bool> resident_;
  std::vector<float> shown_;
};

/// The largest error in px over the cameras that may see a node, from the eight corners of its box
/// and its distance; negative: it is outside.
float brute_error_px(const NodeFacts& facts, std::span<const Camera> cameras) {
  float largest = -1.0f;
  for (const Camera& camera : cameras) {
    if (ClusterCuller(camera).outside(facts.bounds)) continue;
    const glm::mat3 rotation = camera_from_world_rotation(camera.world_from_camera);
    float nearest = std::numeric_limits<float>::infinity();
    for (int corner = 0; corner < 8; ++corner) {
      const glm::vec3 sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
      const glm::vec3 at = facts.bounds.centre + sign * facts.bounds.half_extent;
      nearest = std::min(nearest, (rotation * (at - camera.world_from_camera.position)).z);
    }
    const glm::vec3 &from = camera.world_from_camera.position, &centre = facts.bounds.centre;
    const glm::vec3 closest =
        glm::clamp(from, centre - facts.bounds.half_extent, centre + facts.bounds.half_extent);
    const glm::vec2 half(glm::vec2(camera.size_px) * 0.5f / camera.focal_px);
    nearest = std::max(
        nearest, glm::distance(from, closest) * glm::normalize(glm::vec3(1.3f * half, 1.0f)).z);
    largest = std::max(largest, facts.error * camera.focal_px.x / std::max(nearest, camera.near_z));
  }
  return largest;
}

std::vector<NodeId> children_of(const TreeShape& shape, NodeId node) {
  std::vector<NodeId> children;
  const auto below = static_cast<std::uint8_t>(node.level - 1);
  for (const std::uint32_t i : {2 * node.index, 2 * node.index + 1})
    if (i < shape.nodes_on(below)) children.push_back({below, i});
  return children;
}

/// Checks the promises of choose_cut() for each leaf and all that stands for it.
void expect_sound(const SomePages& tree, std::span<const Camera> cameras, float detail_px) {
  const TreeShape& shape = tree.shape();
  const Cut cut = tree.cut(cameras, detail_px);
  std::map<std::uint64_t, float> missing;
  for (std::size_t i = 0; i < cut.missing.size(); ++i) {
    missing[cut.missing[i].page] = cut.missing[i].error_px;
    if (i > 0) {
      ASSERT_GE(cut.missing[i - 1].error_px, cut.missing[i].error_px);
    }
  }
  std::map<std::pair<int, std::uint32_t>, float> drawn;
  for (const auto& [node, share] : cut.drawn) {
    ASSERT_TRUE(drawn.emplace(std::pair{node.level, node.index}, share).second) << "drawn twice";
    ASSERT_TRUE(tree.resident(node));
    ASSERT_GE(brute_error_px(tree.facts(node), cameras), 0.0f) << "is outside";
  }
  for (std::uint32_t leaf = 0; leaf < shape.leaves(); ++leaf) {
    if (brute_error_px(tree.facts({0, leaf}), cameras) < 0.0f) continue;
    float taken = 1.0f, sum = 0.0f;
    for (int level = shape.levels() - 1; level >= 0 && taken > 0.0f; --level) {
      const NodeId node{static_cast<std::uint8_t>(level), leaf >> level};
      const float error = brute_error_px(tree.facts(node), cameras);
      float split = level == 0 ? 0.0f : std::min(taken, split_share(error, detail_px));
      for (const NodeId child : level == 0 ? std::vector<NodeId>{} : children_of(shape, node)) {
        if (shape.page_of(child) == shape.page_of(node)) continue;
        if (!tree.resident(child) && split > 0.02f) {
          ASSERT_TRUE(missing.contains(shape.page_of(child))) << "is not asked for";
        }
        split = std::min(split, tree.resident(child) ? tree.shown(child) : 0.0f);
      }
      const auto found = drawn.find({level, node.index});
      const float share = found == drawn.end() ? 0.0f : found->second;
      ASSERT_NEAR(share, taken - split, 0.02f) << "node " << level << "." << node.index;
      sum += share;
      taken = split;
    }
    ASSERT_NEAR(sum, 1.0f, 0.02f) << "leaf " << leaf;
  }
}

TEST(Cut, ErrorsBoundThoseOfAllPointsInView) {
  const Camera camera = make_camera(look_at({0, 0, 0}, {0, 0, 5}), {640, 360}, 300.0f);
  const CutEye eye(camera);
  std::mt19937 random(4);
  std::uniform_real_distribution<float> uniform(-1.0f, 1.0f);
  const auto vector = [&] { return glm::vec3(uniform(random), uniform(random), uniform(random)); };
  int beside = 0, in_view = 0;
  for (int i = 0; i < 2000; ++i) {
    const Cluster box{8.0f * vector(), glm::abs(3.0f * vector()), 0.1f};
    const float bound_px = eye.error_px(0.01f, box);
    // Boxes beside the camera that cross its plane.
    beside += box.centre.z < box.half_extent.z && bound_px < 1e6f ? 1 : 0;
    for (int k = 0; k < 100; ++k) {
      const glm::vec3 at = box.centre + box.half_extent * vector();
      const glm::vec2 px = 300.0f * glm::vec2(at) / at.z;
      if (at.z <= camera.near_z || std::abs(px.x) > 320.0f || std::abs(px.y) > 180.0f) continue;
      ++in_view;
      ASSERT_LE(0.01f * 300.0f / at.z, bound_px * 1.0001f);
    }
  }
  EXPECT_GT(beside, 100);
  EXPECT_GT(in_view, 1000);
}

std::vector<Camera> cameras_around() {
  std::vector<Camera> cameras;
  for (const glm::vec3 from :
       {glm::vec3(0, 0, -6), glm::vec3(3, 1, 4), glm::vec3(-20, 5, 5), glm::vec3(0, 0, -300)})
    cameras.push_back(make_camera(look_at(from, {0, 0, 5}), {320, 240}, 200.0f));
  cameras.push_back(make_camera(look_at({0.5f, 0, 4}, {2, 0, 9}), {320, 240}, 500.0f));
  return cameras;
}

TEST(Cut, CutsHaveNoHolesAndDrawNothingTwice) {
  for (const int degree : {0, 3}) {
    SomePages tree(60'001, degree, 8 + static_cast<std::uint64_t>(degree));
    const std::vector<Camera> cameras = cameras_around();
    for (const double share : {1.0, 0.8, 0.3, 0.0}) {
      tree.keep_some(static_cast<std::uint64_t>(100.0 * share), share);
      if (share == 0.8) tree.blend_some(5);
      for (const float detail_px : {0.0f, 0.5f, 2.0f, 30.0f}) {
        SCOPED_TRACE(testing::Message() << share << " of the pages, " << detail_px << " px");
        for (std::size_t c = 0; c < cameras.size(); ++c)
          expect_sound(tree, std::span(cameras).subspan(c, 1), detail_px);
        expect_sound(tree, cameras, detail_px);  // all at once
      }
    }
  }
}

std::vector<std::uint64_t> pages_in(std::span<const PageUse> uses) {
  std::vector<std::uint64_t> pages;
  for (const PageUse& use : uses) pages.push_back(use.page);
  std::ranges::sort(pages);
  return pages;
}

TEST(Cut, PartsAreThoseOfTheWholeCut) {
  SomePages tree(60'001, 3, 12);
  tree.blend_some(5);
  std::size_t used = 0, missing = 0;
  for (const Camera& camera : cameras_around()) {
    const std::span cameras(&camera, 1);
    const Cut all = tree.cut(cameras, 0.5f);
    used = std::max(used, all.used.size());
    missing = std::max(missing, all.missing.size());
    const Cut pages = tree.cut(cameras, 0.5f, {.part = CutParts::Part::pages});
    const Cut drawn = tree.cut(cameras, 0.5f, {.part = CutParts::Part::drawn});
    EXPECT_EQ(pages_in(pages.used), pages_in(all.used));
    EXPECT_EQ(pages_in(pages.missing), pages_in(all.missing));
    EXPECT_TRUE(pages.drawn.empty());
    EXPECT_TRUE(drawn.used.empty() && drawn.missing.empty());
    ASSERT_EQ(drawn.drawn.size(), all.drawn.size());
    ASSERT_EQ(drawn.slots.size(), all.drawn.size());
    for (std::size_t i = 0; i < all.drawn.size(); ++i) {
      EXPECT_EQ(drawn.drawn[i].node, all.drawn[i].node);
      EXPECT_EQ(drawn.drawn[i].share, all.drawn[i].share);
      EXPECT_EQ(drawn.slots[i], 3 * tree.shape().page_of(all.drawn[i].node));
    }
    tree.drop(tree.shape().pages() - 1 - used % 8);  // a page of leaves
  }
  EXPECT_GT(used, 8u) << "pages of leaves";
  EXPECT_GT(missing, 0u);
}

TEST(Cut, HiddenSubtreesAreLeftAsAWhole) {
  const SomePages tree(60'001, 0, 13);
  const auto hidden = [](const Cluster& bounds) {
    return bounds.centre.x - bounds.half_extent.x > 0.5f;
  };
  std::size_t asked = 0;
  const CutParts parts{.part = CutParts::Part::drawn, .hides = [&](const Cluster& bounds) {
                         ++asked;
                         return hidden(bounds);
                       }};
  for (const Camera& camera : cameras_around()) {
    const std::span cameras(&camera, 1);
    std::vector<NodeId> expected, drawn;
    for (const DrawnNode& all : tree.cut(cameras, 0.5f).drawn) {
      bool seen = true;
      for (int level = std::max<int>(all.node.level, 1); level < tree.shape().levels(); ++level)
        seen = seen && !hidden(tree.facts({static_cast<std::uint8_t>(level),
                                           all.node.index >> (level - all.node.level)})
                                   .bounds);
      if (seen) expected.push_back(all.node);
    }
    for (const DrawnNode& some : tree.cut(cameras, 0.5f, parts).drawn) drawn.push_back(some.node);
    EXPECT_EQ(drawn, expected);
    EXPECT_LT(expected.size(), tree.cut(cameras, 0.5f).drawn.size());
    asked = 0;
    const CutParts all_hidden{.hides = [&](const Cluster&) { return ++asked > 0; }};
    EXPECT_TRUE(tree.cut(cameras, 0.0f, all_hidden).drawn.empty());
    EXPECT_EQ(asked, 1u) << "nothing below the root is looked at";
  }
}

TEST(Cut, ZeroDetailIsAllLeaves) {
  const SomePages tree(20'000, 0, 3);
  const Camera far = make_camera(look_at({0, 0, -5000}, {0, 0, 5}), {320, 240}, 200.0f);
  const Cut everything = tree.cut({}, 0.0f), seen = tree.cut(std::span(&far, 1), 0.0f);
  EXPECT_EQ(everything.drawn.size(), tree.shape().leaves());
  ASSERT_EQ(seen.drawn.size(), everything.drawn.size());
  for (std::size_t i = 0; i < seen.drawn.size(); ++i) {
    EXPECT_EQ(seen.drawn[i].node, everything.drawn[i].node);
    EXPECT_EQ(seen.drawn[i].share, 1.0f);
  }
  EXPECT_TRUE(seen.missing.empty());
}

TEST(Cut, FartherIsCoarser) {
  const SomePages tree(60'000, 0, 4);
  std::size_t before = tree.shape().leaves() + 1;
  for (const float distance : {20.0f, 100.0f, 500.0f, 3000.0f}) {
    const Camera camera = make_camera(look_at({0, 0, -distance}, {0, 0, 5}), {640, 480}, 400.0f);
    const std::size_t drawn = tree.cut(std::span(&camera, 1), 1.0f).drawn.size();
    EXPECT_LT(drawn, before);
    before = drawn;
  }
}

TEST(Cut, MissingRootPageIsRequested) {
  SomePages tree(1000, 0, 5);
  tree.drop(0);
  const Cut cut = tree.cut({}, 0.0f);
  EXPECT_TRUE(cut.drawn.empty());
  ASSERT_EQ(cut.missing.size(), 1u);
  EXPECT_EQ(cut.missing[0].page, 0u);
}

TEST(Cut, SharesChangeLittleWithTheCamera) {
  const SomePages tree(60'000, 0, 6);
  std::map<std::pair<int, std::uint32_t>, float> before;
  for (int step = 0; step < 200; ++step) {
    const float distance = 100.0f + 0.1f * static_cast<float>(step);
    const Camera camera = make_camera(look_at({0, 0, -distance}, {0, 0, 5}), {640, 480}, 400.0f);
    std::map<std::pair<int, std::uint32_t>, float> now;
    for (const auto& [node, share] : tree.cut(std::span(&camera, 1), 1.0f).drawn)
      now[{node.level, node.index}] = share;
    if (step > 0) {
      for (const auto& [node, share] : before) EXPECT_NEAR(now[node], share, 0.02f);
      for (const auto& [node, share] : now) EXPECT_NEAR(before[node], share, 0.02f);
    }
    before = now;
  }
  EXPECT_FALSE(before.empty());
}

}  // namespace
}  // namespace catgs::test
