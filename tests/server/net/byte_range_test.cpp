#include "server/net/byte_range.h"

#include <fmt/format.h>

#include "tests/support/test.h"

namespace catgs {
namespace {

std::string range(std::string_view header, std::uint64_t size = 100) {
  const auto found = requested_range(header, size);
  return found ? fmt::format("{}+{}", found->offset, found->length) : "whole";
}

TEST(ByteRange, IsOneRangeOfBytes) {
  EXPECT_EQ(range("bytes=0-0"), "0+1");
  EXPECT_EQ(range("bytes=10-19"), "10+10");
  EXPECT_EQ(range("bytes=90-"), "90+10");
  EXPECT_EQ(range("bytes=-10"), "90+10");
  EXPECT_EQ(range("bytes=0-99999999999999999999999"), "0+100") << "to the end";
  EXPECT_EQ(range("bytes=-1000"), "0+100");
}

TEST(ByteRange, BehindTheEndIsEmpty) {
  EXPECT_EQ(range("bytes=100-"), "100+0");
  EXPECT_EQ(range("bytes=100-200"), "100+0");
  EXPECT_EQ(range("bytes=99999999999999999999999-"), "100+0");
  EXPECT_EQ(range("bytes=-0"), "100+0");
  EXPECT_EQ(range("bytes=0-", 0), "0+0");
  EXPECT_EQ(range("bytes=-5", 0), "0+0");
}

TEST(ByteRange, AnotherFormMeansTheWholeFile) {
  for (const char* header : {"", "bytes", "bytes=", "bytes=-", "bytes=a-b", "bytes=5", "bytes=5-4",
                             "bytes=1-2,4-5", "bytes=1-2,", "bytes= 1-2", "bytes=--2", "bytes=1--2",
                             "bytes=+1-2", "bytes=0x1-2", "lines=1-2", "Bytes=1-2"})
    EXPECT_EQ(range(header), "whole") << header;
}

}  // namespace
}  // namespace catgs
