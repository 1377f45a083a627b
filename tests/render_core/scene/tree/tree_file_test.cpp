#include "render_core/scene/tree/tree_file.h"

#include <functional>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/scene/tree/read_tree.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/render_core/scene/tree/tree_test_support.h"

namespace catgs::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// A tree of 40 leaves: the root's page and 3 pages of leaves.
class TreeFileTest : public ::testing::Test {
 protected:
  static constexpr std::size_t gaussians = 40 * cluster_size - 10;
  TreeFileTest() : bytes_(tree_bytes(random_cloud(gaussians, 0), pool_)), shape_(gaussians, 0) {}

  /// The tree with another header, whose checksum is right.
  [[nodiscard]] std::string with_header(const std::function<void(TreeHeader&)>& change) const {
    std::string bytes = bytes_;
    TreeHeader header;
    std::memcpy(&header, bytes.data(), sizeof header);
    change(header);
    header.checksum = header.right_checksum();
    std::memcpy(bytes.data(), &header, sizeof header);
    return bytes;
  }
  static TreeScene read(std::string bytes) {
    return read_tree(source_of(std::move(bytes)), two_threads());
  }
  /// The page is damaged, and that is said of its `part`.
  static void expect_fault(std::string bytes, std::uint64_t page, const std::string& part) {
    TreeFile tree(source_of(std::move(bytes)));
    EXPECT_EQ(tree.page(page), nullptr);
    EXPECT_EQ(tree.damage().pages, 1u);
    EXPECT_THAT(tree.damage().first,
                AllOf(HasSubstr(fmt::format("a.tree: page {}", page)), HasSubstr(part)));
  }
  /// The same of a page whose checksum is right.
  void expect_fault_with(std::uint64_t page, const std::string& part,
                         const std::function<void(TreePage&)>& change) const {
    expect_fault(with_page(bytes_, page, change), page, part);
  }

  ThreadPool pool_{2};
  std::string bytes_;
  TreeShape shape_;
};

TEST_F(TreeFileTest, HeaderFieldsAreChecked) {
  struct Header {
    void (*change)(TreeHeader&);
    const char* where;
  };
  const auto where = [](const std::string& bytes) {
    return refusal_of([&] { read_tree_header(*source_of(bytes)); }).where;
  };
  for (const Header& header : std::vector<Header>{
           {[](auto& h) { h.magic[0] = 'x'; }, "magic"},
           {[](auto& h) { h.version = 0; }, "version"},
           {[](auto& h) { h.version = 3; }, "version"},
           {[](auto& h) { h.sh_degree = 4; }, "SH degree"},
           {[](auto& h) { h.gaussians = 0; }, "Gaussians"},
           {[](auto& h) { h.gaussians = (std::uint64_t{1} << 34) + 1; }, "Gaussians"},
           {[](auto& h) { h.low.x = NAN; }, "bounds"},
           {[](auto& h) { h.dropped = 1; }, "Gaussians read and dropped"},
           {[](auto& h) { h.source.fill('x'); }, "source"},
           {[](auto& h) { h.levels[1].gaussians = 0; }, "level 1"},
           {[](auto& h) { h.levels[2].mean_error = -1.0f; }, "level 2"},
           {[](auto& h) { --h.levels[0].gaussians; }, "level 0"},
           {[](auto& h) { h.levels[7].max_error = 1.0f; }, "level 7"},
       })
    EXPECT_EQ(where(with_header(header.change)), header.where);
  std::string flipped = bytes_;
  flipped[20] ^= 1;
  EXPECT_EQ(where(flipped), "header");
  EXPECT_EQ(where(bytes_.substr(0, 100)), "byte 0");
}

TEST_F(TreeFileTest, ValuesOfPagesAreCheckedThoughTheirChecksumIsRight) {
  const std::uint64_t leaves = shape_.page_of({0, 0});
  const std::size_t slot = shape_.slot_of({0, 0});
  struct Facts {
    void (*change)(NodeFacts&);
    const char* fault;
  };
  for (const Facts& facts : std::vector<Facts>{
           {[](auto& f) { f.count = 0; }, "count of node 0.0"},
           {[](auto& f) { f.count = 257; }, "count"},
           {[](auto& f) { f.error = NAN; }, "error"},
           {[](auto& f) { f.error = 1.0f; }, "error"},
           {[](auto& f) { f.bounds.centre.y = INFINITY; }, "bounds"},
           {[](auto& f) { f.bounds.half_extent.z *= 0.5f; }, "mean"},
           {[](auto& f) { f.bounds.reach = -1.0f; }, "reach"},
           {[](auto& f) { f.bounds.reach = 1e20f; }, "reach"},
           {[](auto& f) { f.reserved[2] = 7; }, "reserved"},
           {[](auto& f) { f.units.factor *= 1.5f; }, "unit"},
           {[](auto& f) { f.units.factor = 0x1p-100f; }, "unit"},
           {[](auto& f) { f.units.factor = 0x1p100f; }, "unit"},
           {[](auto& f) { f.units.sh[2] = 1e30f; }, "harmonics"},
       })
    expect_fault_with(leaves, facts.fault, [&](TreePage& page) { facts.change(page.facts(slot)); });
  struct Record {
    std::size_t offset;
    std::uint16_t bits;
    const char* fault;
  };
  for (const Record& record : std::vector<Record>{
           {packed_offset(0, 16, 3) + 2, 0x7fc0, "mean"},  // NaN
           {packed_offset(0, 16, 3) + 14, 0x7c00, "colour"},
           {packed_offset(16, 16, 3) + 14, 0xfc01, "colour"},
           {packed_offset(16, 16, 3) + 14, 0xe3d1, "colour"},  // under -1000
       })
    expect_fault_with(leaves, record.fault, [&](TreePage& page) {
      std::memcpy(&page.block(slot)[record.offset], &record.bits, sizeof record.bits);
    });
}

TEST_F(TreeFileTest, UnusedBytesOfPagesAreZeros) {
  const auto facts = [&](std::uint64_t page, std::size_t slot, const auto& change) {
    expect_fault_with(page, fmt::format("facts of unused slot {}", slot),
                      [&](TreePage& forged) { change(forged.facts(slot)); });
  };
  // The root's page has two of its levels, and the last one half of its last row.
  const std::uint64_t last = shape_.page_of({0, 39});
  facts(0, 3, [](auto& f) { f.count = 257; });
  facts(0, 3, [](auto& f) { f.count = 1; });
  facts(0, 30, [](auto& f) { f.error = 1.0f; });
  facts(last, 30, [](auto& f) { f.bounds.centre.x = NAN; });
  const auto byte = [&](std::uint64_t page, std::size_t at, const char* part) {
    expect_fault_with(page, part, [&](TreePage& forged) { forged.bytes()[at] = std::byte{1}; });
  };
  byte(0, shape_.block_offset(3), "records of unused slot 3");
  byte(0, shape_.block_offset(31) - 1, "records of unused slot 30");
  byte(1, 4, "bytes 4 to 63");
  byte(1, 63, "bytes 4 to 63");
  byte(1, shape_.page_bytes() - 1, "bytes behind the last block");
  // The last leaf has 246 records.
  const std::size_t block = shape_.block_offset(shape_.slot_of({0, 39}));
  EXPECT_EQ(read(with_page(bytes_, last, [](TreePage&) {})).notes.size(), 0u);
  byte(last, block + packed_offset(0, 16, 246), "unused records of node 0.39");
  byte(last, block + packed_offset(16, 16, 255) + 15, "unused records of node 0.39");
}

TEST_F(TreeFileTest, ErrorsAndBoundsGrowTowardsTheRoot) {
  const std::uint64_t leaves = shape_.page_of({0, 0});
  const auto grows = [&](const char* part,
                         const std::function<void(NodeFacts & above, NodeFacts & node)>& change) {
    expect_fault_with(leaves, part, [&](TreePage& page) { change(page.facts(1), page.facts(3)); });
  };
  grows("error of node 2.0", [](auto& above, auto& node) { node.error = 2.0f * above.error; });
  grows("reach of node 2.0",
        [](auto& above, auto& node) { node.bounds.reach = 2.0f * above.bounds.reach; });
  grows("box of node 2.0", [](auto& above, auto& node) {
    node.bounds.half_extent.y += 2.0f * above.bounds.half_extent.y;
  });
  TreeFile tree(source_of(bytes_));
  NodeFacts above = tree.page(0)->facts(shape_.slot_of({5, 0}));
  EXPECT_NE(tree.page(leaves, &above), nullptr);
  above.error = 0.0f;
  EXPECT_EQ(tree.page(leaves, &above), nullptr);
  EXPECT_THAT(tree.damage().first, HasSubstr("error of node 4.0"));
}

// Records of version 1 have no octaves: all bits of an opacity are its own.
TEST_F(TreeFileTest, TreesOfTheFirstVersionAreRead) {
  const GaussianCloud cloud = random_cloud(200, 3);
  const GaussianCloud now = read(tree_bytes(cloud, pool_)).cloud;
  std::string bytes = tree_bytes(cloud, pool_);
  auto header = load_as<TreeHeader>(std::as_bytes(std::span(bytes)).data());
  header.version = TreeHeader::first_version;
  header.checksum = header.right_checksum();
  std::memcpy(bytes.data(), &header, sizeof header);
  std::vector<float> octaves, opacities;
  bytes = with_page(bytes, 0, [&](TreePage& page) {
    for (std::uint32_t i = 0; i < 200; ++i) {
      std::byte* const at = &page.block(0)[packed_offset(0, 16, i) + 12];
      std::uint16_t level = 0;
      std::memcpy(&level, at, sizeof level);
      octaves.push_back(packed_sh_octave(level));
      level = static_cast<std::uint16_t>(300 * i);
      opacities.push_back(std::exp2(unpack_log2_opacity(level)));
      std::memcpy(at, &level, sizeof level);
    }
  });
  EXPECT_GT(std::ranges::max(octaves), std::ranges::min(octaves));
  const GaussianCloud first = read(bytes).cloud;
  ASSERT_EQ(first.size(), 200u);
  for (std::size_t i = 0; i < 200; ++i) {
    EXPECT_NEAR(first.opacity[i], opacities[i], 0.0014f * opacities[i]);
    for (int k = 0; k < 16; ++k)
      for (int c = 0; c < 3; ++c)
        EXPECT_FLOAT_EQ(first.sh_of(i)[k][c] * (k == 0 ? 1.0f : octaves[i]), now.sh_of(i)[k][c]);
  }
}

TEST_F(TreeFileTest, PagesOfOtherPlacesAreNotTaken) {
  std::string bytes = bytes_;
  const auto at = [&](NodeId node) { return shape_.page_offset(shape_.page_of(node)); };
  bytes.replace(at({0, 0}), shape_.page_bytes(), bytes_, at({0, 16}), shape_.page_bytes());
  expect_fault(bytes, shape_.page_of({0, 0}), "checksum");
}

TEST_F(TreeFileTest, ADamagedPageCostsDetailAndNoRegion) {
  std::string bytes = bytes_;
  const std::uint64_t page = shape_.page_of({0, 20});
  bytes[shape_.page_offset(page) + 5000] ^= 0x10;
  const TreeScene scene = read(bytes), whole = read(bytes_);
  EXPECT_TRUE(whole.notes.empty());
  ASSERT_EQ(scene.notes.size(), 1u);
  EXPECT_THAT(scene.notes[0],
              AllOf(HasSubstr("1 of 4 pages"), HasSubstr("page " + std::to_string(page))));
  // A node of the root's page stands for the 32 leaves of the page and its neighbour.
  EXPECT_EQ(whole.cloud.size(), gaussians);
  EXPECT_EQ(scene.cloud.size(), gaussians - 31 * cluster_size);
}

TEST_F(TreeFileTest, ACutFileShowsWhatIsLeft) {
  for (std::uint64_t pages = 1; pages <= shape_.pages(); ++pages) {
    const TreeScene scene = read(bytes_.substr(0, shape_.page_offset(pages)));
    EXPECT_EQ(scene.notes.empty(), pages == shape_.pages());
    EXPECT_FALSE(scene.cloud.empty());
    EXPECT_EQ(scene.cloud.size() == gaussians, pages == shape_.pages());
  }
  EXPECT_EQ(refusal_of([&] { read(bytes_.substr(0, shape_.page_offset(1) - 1)); }).where, "page 0");
}

TEST_F(TreeFileTest, MoreThanFitIntoASceneAreRefusedBeforeAnythingIsRead) {
  const std::string bytes = with_header([](TreeHeader& h) {
    h.gaussians = std::uint64_t{1} << 33;
    h.read = h.gaussians + h.dropped;
    const TreeShape shape(h.gaussians, 0);
    for (int l = 0; l < shape.levels(); ++l)
      h.levels[static_cast<std::size_t>(l)] = {shape.nodes_on(l) * cluster_size, 0.0f, 0.0f};
  });
  EXPECT_EQ(refusal_of([&] { read(bytes); }).source, "a.tree");
}

}  // namespace
}  // namespace catgs::test
