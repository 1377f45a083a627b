#include "render_core/walk/walk_file.h"

#include <cstring>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "tests/render_core/walk/hand_made_map.h"
#include "tests/render_core/walk/seal.h"
#include "tests/render_core/walk/worlds.h"

namespace catgs::walk {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

WalkMap read(const std::string& bytes) {
  return read_walk_file(MemorySource("x.walk", std::as_bytes(std::span(bytes))));
}

std::string refusal(const std::string& bytes) {
  try {
    read(bytes);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// A small file with `value` at `offset` and the right checksum.
template <class T>
std::string with(std::size_t offset, T value) {
  std::string bytes = pack(test::hand_made_map({3, 2}, [](int, int) { return Kind::clear; }));
  std::memcpy(bytes.data() + offset, &value, sizeof value);
  test::seal(bytes);
  return bytes;
}

TEST(WalkFile, KeepsAMap) {
  const WalkMap map = test::map_of(test::stairs(), {0, 3, 1.6f});
  const WalkMap back = read(pack(map));
  EXPECT_EQ(back.size, map.size);
  EXPECT_EQ(back.first, map.first);
  EXPECT_EQ(back.places, map.places);
  EXPECT_EQ(back.grid.axes, map.grid.axes);
  EXPECT_EQ(back.grid.origin, map.grid.origin);
  EXPECT_EQ(back.start.height, map.start.height);
  ASSERT_EQ(back.storeys.size(), map.storeys.size());
  EXPECT_EQ(back.storeys[1].area, map.storeys[1].area);
}

TEST(WalkFile, KeepsAMapOfManyTiles) {
  const WalkMap map = test::hand_made_map({150, 70}, [](int x, int y) {
    return x < 64 && y < 64 ? Kind{9} : static_cast<Kind>((x + 3 * y) % 4);
  });
  WalkMap there = map;
  there.start.place = {64.5f, 0.5f};
  EXPECT_TRUE(tiles_of(map)[0].empty());
  EXPECT_EQ(tiles_of(map).size(), 6u);
  const WalkMap back = read(pack(there));
  EXPECT_EQ(back.first, map.first);
  EXPECT_EQ(back.places, map.places);
}

TEST(WalkFile, ARoomTakesFewBytes) {
  const WalkMap map = test::map_of(test::room(0.9f), {2, 2, 1.6f});
  EXPECT_GT(map.places.size(), 4000u);
  EXPECT_LT(pack(map).size(), 4000u);
}

TEST(WalkFile, CutOffOrChangedFilesAreRefused) {
  const std::string whole = pack(test::hand_made_map({3, 2}, [](int, int) { return Kind::clear; }));
  EXPECT_EQ(read(whole).places.size(), 6u);
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_NE(refusal(whole.substr(0, size)), "") << size;
  for (std::size_t k = 0; k < whole.size(); ++k) {
    std::string changed = whole;
    changed[k] = static_cast<char>(changed[k] ^ 16);
    EXPECT_THAT(refusal(changed), HasSubstr("x.walk")) << k;
  }
}

TEST(WalkFile, ForgedFieldsAreNamed) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(refusal(with(16, nan)), HasSubstr("origin"));
  EXPECT_THAT(refusal(with(28, 0.5f)), HasSubstr("axes"));
  EXPECT_THAT(refusal(with(64, 0.0f)), HasSubstr("cell"));
  EXPECT_THAT(refusal(with(68, -1.0f)), HasSubstr("person"));
  EXPECT_THAT(refusal(with(92, nan)), HasSubstr("start"));
  EXPECT_THAT(refusal(with(92, 2000.0f)), AllOf(HasSubstr("start"), HasSubstr("not clear ground")));
  EXPECT_THAT(refusal(with(104, 5000u)), HasSubstr("size"));
  EXPECT_THAT(refusal(with(104, 2u)), HasSubstr("a tile"));
  EXPECT_THAT(refusal(with(8, 1u)), HasSubstr("compute it with this version"));
  EXPECT_THAT(refusal(with(112, 0xffffffffu)), HasSubstr("places: are too many"));
  EXPECT_THAT(refusal(with(112, 5u)), HasSubstr("a tile: has too many places"));
  EXPECT_THAT(refusal(with(112, 7u)), HasSubstr("tiles"));
  EXPECT_THAT(refusal(with(116, 20u)), HasSubstr("tile side"));
  EXPECT_THAT(refusal(with(320, 4u)), HasSubstr("index: is not that of the tiles"));
  EXPECT_THAT(refusal(with(320, 4000u)), HasSubstr("index"));
  EXPECT_THAT(refusal(with(324, 0u)), HasSubstr("index: has a tile of a wrong size"));
  EXPECT_THAT(refusal(with(324, 13u)), HasSubstr("a tile: cannot be unpacked"));
  EXPECT_THAT(refusal(with(324, 500u)), HasSubstr("a tile: cannot be unpacked"));
  EXPECT_THAT(refusal(with(120, 7u)), HasSubstr("packed bytes"));
  EXPECT_THAT(refusal(with(124, 17u)), HasSubstr("storeys"));
  EXPECT_THAT(refusal(with(128, nan)), HasSubstr("storeys"));
}

TEST(WalkFile, ForgedTilesAreRefused) {
  const WalkMap map = test::hand_made_map({3, 2}, [](int, int) { return Kind::clear; });
  const std::string header = pack(map).substr(0, test::walk_header_bytes);
  const auto refused = [&](const std::string& tile) {
    return refusal(test::packed(header, std::span(&tile, 1)));
  };
  // Six columns of one place at height 160, the first one as a varint of two bytes.
  const std::string counts(6, 1), kinds(6, 0),
      heights = std::string("\xc0\x02", 2) + std::string(5, 0);
  EXPECT_EQ(refused(counts + kinds + heights), "");
  EXPECT_THAT(refused(std::string("\6\0\0\0\0\0", 6) + kinds + heights), HasSubstr("a place"));
  EXPECT_THAT(refused(std::string("\2\1\1\1\1\0", 6) + kinds + heights), HasSubstr("a place"));
  EXPECT_THAT(refused(counts + std::string(6, 4) + heights), HasSubstr("a place"));
  EXPECT_THAT(refused(counts + kinds + std::string(7, '\x80')), HasSubstr("heights"));
  EXPECT_THAT(refused(counts + kinds + std::string(7, '\1')), HasSubstr("a place"));
  EXPECT_THAT(refused(counts + kinds + heights + '\0'), HasSubstr("more than its places"));
  EXPECT_THAT(refused(std::string(6, 65) + kinds + heights), HasSubstr("too many places"));
  EXPECT_THAT(refused(std::string(12, 1)), HasSubstr("heights: are cut off"));
  EXPECT_THAT(refused(""), HasSubstr("places: are more than the tiles have"));
}

TEST(WalkFile, BytesBehindATileAreRefused) {
  std::string bytes = with(0, 'c') + std::string(5, 'x');
  for (const std::size_t at : {std::size_t{120}, test::walk_header_bytes}) {
    std::uint32_t size = 0;
    std::memcpy(&size, bytes.data() + at, sizeof size);
    size += 5;
    std::memcpy(bytes.data() + at, &size, sizeof size);
  }
  test::seal(bytes);
  EXPECT_THAT(refusal(bytes), HasSubstr("a tile: cannot be unpacked"));
}

/// A header and an index that name much more than the tiles can hold cost no memory.
TEST(WalkFile, NoMoreIsUnpackedThanDeflateCanMake) {
  std::string bytes = with(112, 1u << 24);
  EXPECT_THAT(refusal(bytes), HasSubstr("places: are too many"));
  const std::uint32_t side = 64, places = 64 * 4096, unpacked = 4096 * 257;
  std::memcpy(bytes.data() + 104, &side, 4);
  std::memcpy(bytes.data() + 108, &side, 4);
  std::memcpy(bytes.data() + 112, &places, 4);
  test::seal(bytes);
  EXPECT_THAT(refusal(bytes), HasSubstr("places: are more than the tiles have"));
  std::memcpy(bytes.data() + 324, &unpacked, 4);
  test::seal(bytes);
  EXPECT_THAT(refusal(bytes), HasSubstr("index: has a tile of a wrong size"));
}

}  // namespace
}  // namespace catgs::walk
