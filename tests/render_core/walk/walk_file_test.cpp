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
  EXPECT_THAT(refusal(with(92, 2000.0f)), AllOf(HasSubstr("start"), HasSubstr("no clear ground")));
  EXPECT_THAT(refusal(with(104, 5000u)), HasSubstr("size"));
  EXPECT_THAT(refusal(with(104, 2u)), HasSubstr("columns"));
  EXPECT_THAT(refusal(with(112, 0xffffffffu)), HasSubstr("places"));
  EXPECT_THAT(refusal(with(116, 20u)), HasSubstr("stream"));
  EXPECT_THAT(refusal(with(120, 7u)), HasSubstr("packed bytes"));
  EXPECT_THAT(refusal(with(124, 17u)), HasSubstr("storeys"));
  EXPECT_THAT(refusal(with(128, nan)), HasSubstr("storeys"));
}

TEST(WalkFile, ForgedStreamsAreRefused) {
  const WalkMap map = test::hand_made_map({3, 2}, [](int, int) { return Kind::clear; });
  const std::string header = pack(map).substr(0, test::walk_header_bytes);
  const auto refused = [&](const std::string& stream) {
    return refusal(test::packed(header, stream));
  };
  // Six columns of one place at height 160, the first one as a varint of two bytes.
  const std::string counts(6, 1), kinds(6, 0),
      heights = std::string("\xc0\x02", 2) + std::string(5, 0);
  EXPECT_EQ(refused(counts + kinds + heights), "");
  EXPECT_THAT(refused(std::string("\6\0\0\0\0\0", 6) + kinds + heights), HasSubstr("a place"));
  EXPECT_THAT(refused(std::string(6, 2) + kinds + heights), HasSubstr("a place"));
  EXPECT_THAT(refused(counts + std::string(6, 4) + heights), HasSubstr("a place"));
  EXPECT_THAT(refused(counts + kinds + std::string(7, '\x80')), HasSubstr("heights"));
  EXPECT_THAT(refused(counts + kinds + std::string(7, '\1')), HasSubstr("a place"));
  EXPECT_THAT(refused(counts + kinds + heights + '\0'), HasSubstr("columns"));
}

/// A header that names much more than its stream can hold costs no memory.
TEST(WalkFile, NoMoreIsUnpackedThanDeflateCanMake) {
  std::string bytes = with(104, 2048u);
  const std::uint32_t size = 2048, places = 1u << 24, unpacked = (1u << 22) + (2u << 24);
  std::memcpy(bytes.data() + 108, &size, 4);
  std::memcpy(bytes.data() + 112, &places, 4);
  std::memcpy(bytes.data() + 116, &unpacked, 4);
  test::seal(bytes);
  EXPECT_THAT(refusal(bytes), HasSubstr("packed bytes"));
}

}  // namespace
}  // namespace catgs::walk
