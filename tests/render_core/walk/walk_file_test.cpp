#include "render_core/walk/walk_file.h"

#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/render_core/walk/hand_made_map.h"
#include "tests/render_core/walk/seal.h"
#include "tests/render_core/walk/worlds.h"
#include "tests/support/refusal.h"

namespace catgs::walk {
namespace {

WalkMap read(const std::string& bytes) {
  return read_walk_file(MemorySource("x.walk", std::as_bytes(std::span(bytes))));
}

/// The field that a file is refused for.
std::string refused_field(const std::string& bytes) {
  const test::Refusal refusal = test::refusal_of([&] { read(bytes); });
  EXPECT_EQ(refusal.source, "x.walk");
  return refusal.where;
}

struct Forged {
  std::string bytes;
  const char* field;
};
void expect_refused(const std::vector<Forged>& files) {
  for (const Forged& file : files)
    EXPECT_EQ(refused_field(file.bytes), file.field) << "file " << &file - files.data();
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
  EXPECT_EQ(back.positions, map.positions);
  EXPECT_EQ(back.grid.axes, map.grid.axes);
  EXPECT_EQ(back.grid.origin, map.grid.origin);
  EXPECT_EQ(back.start.height, map.start.height);
  ASSERT_EQ(back.storeys.size(), map.storeys.size());
  EXPECT_EQ(back.storeys[1].area, map.storeys[1].area);
}

TEST(WalkFile, KeepsTheOriginOfTheScene) {
  WalkMap map = test::hand_made_map({3, 2}, [](int, int) { return Kind::clear; });
  map.origin = {500123.0, 5412345.0, 431.0};
  const std::string bytes = pack(map);
  EXPECT_EQ(read(bytes).origin, map.origin);
  EXPECT_EQ(read(bytes).positions, map.positions);
  std::string changed = bytes;
  const double nowhere = 1e10;
  std::memcpy(changed.data() + 320, &nowhere, sizeof nowhere);
  test::seal(changed);
  EXPECT_EQ(test::refusal_of([&] { read(changed); }).where, "origin of the scene");
  changed = bytes.substr(0, 330);
  test::seal(changed);
  EXPECT_EQ(test::refusal_of([&] { read(changed); }).where, "origin of the scene");
  map.origin = {};
  EXPECT_EQ(read(pack(map)).origin, map.origin);
  EXPECT_EQ(pack(map).size(), bytes.size() - 24) << "as files always were";
}

TEST(WalkFile, KeepsAMapOfManyTiles) {
  const WalkMap map = test::hand_made_map({150, 70}, [](int x, int y) {
    return x < 64 && y < 64 ? Kind{9} : static_cast<Kind>((x + 3 * y) % 4);
  });
  WalkMap there = map;
  there.start.position = {64.5f, 0.5f};
  EXPECT_TRUE(tiles_of(map)[0].empty());
  EXPECT_EQ(tiles_of(map).size(), 6u);
  const WalkMap back = read(pack(there));
  EXPECT_EQ(back.first, map.first);
  EXPECT_EQ(back.positions, map.positions);
}

TEST(WalkFile, ARoomTakesFewBytes) {
  const WalkMap map = test::map_of(test::room(0.9f), {2, 2, 1.6f});
  EXPECT_GT(map.positions.size(), 4000u);
  EXPECT_LT(pack(map).size(), 4000u);
}

TEST(WalkFile, CutOffOrChangedFilesAreRefused) {
  const std::string whole = pack(test::hand_made_map({3, 2}, [](int, int) { return Kind::clear; }));
  EXPECT_EQ(read(whole).positions.size(), 6u);
  for (std::size_t size = 0; size < whole.size(); ++size) refused_field(whole.substr(0, size));
  for (std::size_t k = 0; k < whole.size(); ++k) {
    std::string changed = whole;
    changed[k] = static_cast<char>(changed[k] ^ 16);
    refused_field(changed);
  }
}

TEST(WalkFile, ForgedFieldsAreNamed) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  expect_refused({
      {with(8, 1u), "version"},      {with(16, nan), "origin"},
      {with(28, 0.5f), "axes"},      {with(64, 0.0f), "cell"},
      {with(68, -1.0f), "person"},   {with(92, nan), "start"},
      {with(92, 2000.0f), "start"},  {with(104, 5000u), "size"},
      {with(104, 2u), "a tile"},     {with(112, 0xffffffffu), "places"},
      {with(112, 5u), "a tile"},     {with(112, 7u), "tiles"},
      {with(116, 20u), "tile side"}, {with(120, 7u), "packed bytes"},
      {with(124, 17u), "storeys"},   {with(128, nan), "storeys"},
      {with(320, 4u), "index"},      {with(320, 4000u), "index"},
      {with(324, 0u), "index"},      {with(324, 13u), "a tile"},
      {with(324, 500u), "a tile"},
  });
  EXPECT_EQ(test::input_error([] { read(with(92, 2000.0f)); }),
            "x.walk: start: is not clear ground (the file is damaged: compute it again)");
}

TEST(WalkFile, ForgedTilesAreRefused) {
  const WalkMap map = test::hand_made_map({3, 2}, [](int, int) { return Kind::clear; });
  const std::string header = pack(map).substr(0, test::walk_header_bytes);
  const auto tiled = [&](const std::string& tile) {
    return test::packed(header, std::span(&tile, 1));
  };
  // Six columns of one place at height 160, the first one as a varint of two bytes.
  const std::string counts(6, 1), kinds(6, 0),
      heights = std::string("\xc0\x02", 2) + std::string(5, 0);
  EXPECT_NO_THROW(read(tiled(counts + kinds + heights)));
  expect_refused({
      {tiled(std::string("\6\0\0\0\0\0", 6) + kinds + heights), "a place"},
      {tiled(std::string("\2\1\1\1\1\0", 6) + kinds + heights), "a place"},
      {tiled(counts + std::string(6, 4) + heights), "a place"},
      {tiled(counts + kinds + std::string(7, '\1')), "a place"},
      {tiled(counts + kinds + std::string(7, '\x80')), "heights"},
      {tiled(std::string(12, 1)), "heights"},
      {tiled(counts + kinds + heights + '\0'), "a tile"},
      {tiled(std::string(6, 65) + kinds + heights), "a tile"},
      {tiled(""), "places"},
  });
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
  EXPECT_EQ(refused_field(bytes), "a tile");
}

/// A header and an index that name much more than the tiles can hold cost no memory.
TEST(WalkFile, NoMoreIsUnpackedThanDeflateCanMake) {
  std::string bytes = with(112, 1u << 24);
  EXPECT_EQ(refused_field(bytes), "places");
  const std::uint32_t side = 64, positions = 64 * 4096, unpacked = 4096 * 257;
  std::memcpy(bytes.data() + 104, &side, 4);
  std::memcpy(bytes.data() + 108, &side, 4);
  std::memcpy(bytes.data() + 112, &positions, 4);
  test::seal(bytes);
  EXPECT_EQ(refused_field(bytes), "places");
  std::memcpy(bytes.data() + 324, &unpacked, 4);
  test::seal(bytes);
  EXPECT_EQ(refused_field(bytes), "index");
}

}  // namespace
}  // namespace catgs::walk
