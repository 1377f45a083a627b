#include <cmath>
#include <string>

#include <nlohmann/json.hpp>

#include "tests/load/unpacked_depths.h"
#include "tests/support/test.h"

namespace catgs::load {
namespace {

std::vector<std::byte> bytes_of(const std::string& hex) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i < hex.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  return bytes;
}

/// A street: the ground below, a near wall on the left, sky above.
std::vector<float> street(glm::ivec2 cells) {
  std::vector<float> inverse_depths;
  for (int y = 0; y < cells.y; ++y)
    for (int x = 0; x < cells.x; ++x) {
      const float ground =
          std::max(0.0f, 2.0f * static_cast<float>(y) / static_cast<float>(cells.y) - 1.0f) / 1.6f;
      inverse_depths.push_back(x < cells.x / 5 ? 0.8f : ground);
    }
  return inverse_depths;
}

TEST(PackedDepths, ReadBackWithinAStep) {
  for (const glm::ivec2 cells : {glm::ivec2(1), glm::ivec2(64, 36), glm::ivec2(5, 128)}) {
    const std::vector<float> inverse_depths = street(cells);
    const PackedDepths packed = pack({cells, inverse_depths});
    EXPECT_EQ(packed.cells, cells);
    const auto unpacked = unpack(packed);
    ASSERT_TRUE(unpacked);
    ASSERT_EQ(unpacked->size(), inverse_depths.size());
    for (std::size_t i = 0; i < unpacked->size(); ++i) {
      const float code = std::sqrt(inverse_depths[i] / std::max(packed.scale, 1e-9f));
      ASSERT_NEAR((*unpacked)[i], inverse_depths[i], packed.scale * (code + 1.0f)) << i;
    }
  }
}

TEST(PackedDepths, EmptyPicturesStayEmpty) {
  const std::vector<float> nothing(6, 0.0f);
  EXPECT_EQ(unpack(pack({{3, 2}, nothing})), nothing);
}

TEST(PackedDepths, StreetsAreSmall) {
  EXPECT_LT(pack({{64, 36}, street({64, 36})}).codes.size(), 400u);
}

// tests/web_client/depth_mesh.test.ts unpacks the same bytes.
TEST(PackedDepths, SharedBytesReadBack) {
  std::ifstream file(CATGS_WARP_GOLDEN);
  const auto mesh = nlohmann::json::parse(file).at("mesh");
  const auto unpacked = unpack({{mesh.at("columns"), mesh.at("rows")},
                                mesh.at("scale"),
                                bytes_of(mesh.at("codes").get<std::string>())});
  ASSERT_TRUE(unpacked);
  ASSERT_EQ(unpacked->size(), mesh.at("inverse_depths").size());
  for (std::size_t i = 0; i < unpacked->size(); ++i)
    EXPECT_NEAR((*unpacked)[i], mesh.at("inverse_depths")[i].get<float>(), 1e-6f) << i;
}

TEST(PackedDepths, BrokenOnesAreRefused) {
  const PackedDepths whole = pack({{64, 36}, street({64, 36})});
  const auto refused = [&](auto change) {
    PackedDepths broken = whole;
    change(broken);
    return !unpack(broken).has_value();
  };
  EXPECT_FALSE(refused([](PackedDepths&) {}));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.codes.pop_back(); }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.codes.push_back({}); }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.codes.clear(); }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.codes[0] = std::byte{0xff}; }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.cells.y = 35; }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.cells.y = 37; }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.cells = {0, 36}; }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.cells = {-64, -36}; }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.cells = {64, max_depth_cells + 1}; }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.scale = -1.0f; }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.scale = NAN; }));
  EXPECT_TRUE(refused([](PackedDepths& p) { p.scale = 1e38f; }));
}

TEST(PackedDepths, CellsAreAboutSquareWhateverTheShapeOfThePicture) {
  EXPECT_EQ(depth_cells_of({1280, 720}), glm::ivec2(64, 36));
  EXPECT_EQ(depth_cells_of({720, 1280}), glm::ivec2(36, 64));
  EXPECT_EQ(depth_cells_of({8192, 16}), glm::ivec2(128, 2));
  EXPECT_EQ(depth_cells_of({2 * 1680, 1760}, 2), glm::ivec2(2 * 47, 49));
  EXPECT_EQ(depth_cells_of({2 * 8192, 16}, 2), glm::ivec2(128, 2));
}

}  // namespace
}  // namespace catgs::load
