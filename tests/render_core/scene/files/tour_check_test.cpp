#include "render_core/scene/files/tour_check.h"

#include <fmt/format.h>

#include "render_core/scene/files/media_name.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using namespace std::string_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;

class ToursOnDisk : public FolderTest {
 protected:
  std::string mistake(const std::string& stop) {
    write("hall.json", fmt::format(R"({{"tours": [{{"stops": [{}]}}]}})", stop));
    return mistake_in_tours({folder_ / "hall.json", {}, {}}).value_or("");
  }
};

// tests/server/scenes/tours_test.cpp tests what check_tours() finds, as authors meet it.
TEST_F(ToursOnDisk, MistakesNameFileAndField) {
  EXPECT_FALSE(mistake_in_tours({folder_ / "hall.json", {}, {}}));
  EXPECT_EQ(mistake(R"({"position": [0, 0, 0], "look_at": [0, 0, 1]})"), "");
  EXPECT_THAT(mistake(R"({"position": [0, 0, 0], "look_at": [0, 0, 1], "titel": "Door"})"),
              AllOf(HasSubstr("hall.json: tours[0].stops[0]: unknown field 'titel'"),
                    HasSubstr("known are title")));
  write("hall.json", "{ broken");
  EXPECT_THAT(mistake_in_tours({folder_ / "hall.json", {}, {}}).value(),
              HasSubstr("hall.json: byte"));
}

TEST_F(ToursOnDisk, MediaOfAnySiteNeedHttps) {
  const auto shows = [&](const char* src) {
    return mistake(fmt::format(
        R"({{"position": [0, 0, 0], "look_at": [0, 0, 1], "media": [{{"src": "{}"}}]}})", src));
  };
  EXPECT_EQ(shows("https://media.example/a.mp4"), "");
  EXPECT_THAT(shows("http://media.example/a.mp4"), HasSubstr("media[0].src"));
}

TEST(MediaName, NamesArePlainPathComponents) {
  for (const char* name : {"a.jpg", "A-b_c.2.webp", "0", "-.png"})
    EXPECT_TRUE(is_media_name(name)) << name;
  EXPECT_TRUE(is_media_name(std::string(100, 'a')));
  EXPECT_FALSE(is_media_name(std::string(101, 'a')));
  for (const std::string& name : {""s, "."s, ".."s, ".a.jpg"s, "a/b.jpg"s, "..\\a"s, "a b.jpg"s,
                                  "a%2fb"s, "\xc3\xa9.jpg"s, "a\0.jpg"s, "a\n"s, "a?b"s, "a:b"s})
    EXPECT_FALSE(is_media_name(name)) << name;
}

}  // namespace
}  // namespace catgs::test
