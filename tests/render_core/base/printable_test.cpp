#include "render_core/base/printable.h"

#include <cstdint>
#include <string>
#include <utility>

#include <gtest/gtest.h>

namespace catgs {
namespace {

enum class Category { printable, unprintable, unassigned };
struct CategoryRange {
  std::uint32_t first, last;
  Category category;
};
#include "unicode_categories.inc"  // by write_categories.py

TEST(Printable, FollowsTheUnicodeData) {
  for (const auto& [first, last, category] : categories)
    for (std::uint32_t c = first; c <= last && category != Category::unassigned; ++c)
      EXPECT_EQ(is_printable(c), category == Category::printable) << std::hex << c;
  EXPECT_FALSE(is_printable(0x13430) || is_printable(0x1343f)) << "assigned by Unicode 15.0";
}

TEST(Printable, ControlCharactersComeOutByTheirBytes) {
  EXPECT_EQ(printable({"a\0\t\n\x1b[2J\x7f", 9}), R"(a\x00\x09\x0a\x1b[2J\x7f)");
  // U+009B begins what ESC [ begins, where a terminal knows it.
  EXPECT_EQ(printable("\xc2\x80 \xc2\x9b"
                      "2J \xc2\x9f"),
            R"(\xc2\x80 \xc2\x9b2J \xc2\x9f)");
}

TEST(Printable, LettersStay) {
  const std::string first_and_last =
      " ~ \xc2\xa0 \xdf\xbf \xe0\xa0\x80 \xed\x9f\xbf \xee\x80\x80 \xef\xbf\xbd "
      "\xf0\x90\x80\x80 \xf4\x8f\xbf\xbd";
  EXPECT_EQ(printable(first_and_last), first_and_last);
  EXPECT_EQ(printable("Gärten, 庭園, 🌳"), "Gärten, 庭園, 🌳");
}

/// They hide in a name, turn round the text behind them or begin a line, without a control
/// character.
TEST(Printable, FormatCharactersComeOutByTheirBytes) {
  EXPECT_EQ(printable("a\u202ecod.exe"), R"(a\xe2\x80\xaecod.exe)");  // right-to-left override
  EXPECT_EQ(printable("\u2066\u200b\u2028\u2029"),
            R"(\xe2\x81\xa6\xe2\x80\x8b\xe2\x80\xa8\xe2\x80\xa9)");
  EXPECT_EQ(printable("\u00ad\ufeff\U000e0041"), R"(\xc2\xad\xef\xbb\xbf\xf3\xa0\x81\x81)");
  EXPECT_EQ(printable("\ufdd0\uffff\U0010fffe"), R"(\xef\xb7\x90\xef\xbf\xbf\xf4\x8f\xbf\xbe)");
  for (const char* beside : {"\u00ac", "\u00ae", "\u200a", "\u2010", "\u2027", "\u202f", "\u2065",
                             "\u2070", "\ufffc", "\U000e0100"})
    EXPECT_EQ(printable(beside), beside);
}

TEST(Printable, InvalidUtf8IsPrintedByteByByte) {
  for (const auto& [text, wanted] : {
           std::pair{"\x9b", R"(\x9b)"},
           {"\xff", R"(\xff)"},
           {"a\xc3", R"(a\xc3)"},
           {"\xe2\x82", R"(\xe2\x82)"},
           {"\xc3(", R"(\xc3()"},
           {"\xe2\x82z", R"(\xe2\x82z)"},
           {"\xc1\x9b", R"(\xc1\x9b)"},                  // too long for U+005B
           {"\xe0\x82\x9b", R"(\xe0\x82\x9b)"},          // too long for U+009B
           {"\xf0\x80\x82\x9b", R"(\xf0\x80\x82\x9b)"},  // the same
           {"\xed\xa0\x80", R"(\xed\xa0\x80)"},          // surrogate
           {"\xf4\x90\x80\x80", R"(\xf4\x90\x80\x80)"},  // U+110000
           {"\xf8\x88\x80\x80\x80", R"(\xf8\x88\x80\x80\x80)"},
           {"\xe2\xc3\xbc", "\\xe2\u00fc"},  // a letter after half a character
       })
    EXPECT_EQ(printable(text), wanted);
}

TEST(Shortened, EndsWithAWholeCharacterWhereThereAreSome) {
  EXPECT_EQ(shortened("ab\u20ac", 5), "ab\u20ac");
  for (const std::size_t bytes : {2u, 3u, 4u}) EXPECT_EQ(shortened("ab\u20ac", bytes), "ab");
  const std::string none(200, '\x80');
  EXPECT_EQ(shortened("abc" + none, 100), "abc" + none.substr(0, 97));
  EXPECT_EQ(shortened("abc", 0), "");
}

TEST(Printable, IsIdempotent) {
  std::string bytes;
  for (int first = 0; first < 256; ++first)
    for (int second = 0; second < 256; ++second)
      bytes.append(1, static_cast<char>(first)).append(1, static_cast<char>(second));
  const std::string once = printable(bytes);
  EXPECT_EQ(printable(once), once);
}

}  // namespace
}  // namespace catgs
