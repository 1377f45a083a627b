#include "render_core/scene/files/tour_check.h"

#include <algorithm>

#include <fmt/format.h>

#include "render_core/scene/files/media_name.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using namespace std::string_literals;
using ::testing::StartsWith;

class ToursOnDisk : public FolderTest {
 protected:
  /// The mistake in `content` of the sidecar, without the part that all warnings begin with.
  std::string mistake_in(const std::string& content) {
    const auto path = write("hall.json", content);
    const std::string warning = mistake_for_pages({path, {}, {}}).value_or("");
    const std::string start = std::string(faulty_for_pages) + path.string() + ": ";
    EXPECT_TRUE(warning.empty() || warning.starts_with(start)) << warning;
    return warning.substr(std::min(start.size(), warning.size()));
  }
  std::string mistake(const std::string& more_of_stop) {
    return mistake_in(fmt::format(
        R"({{"tours": [{{"stops": [{{"position": [0, 0, 0], "look_at": [0, 0, 1]{}}}]}}]}})",
        more_of_stop));
  }
};

// tests/server/scenes/tours_test.cpp tests what check_page_fields() finds, as authors meet it.
TEST_F(ToursOnDisk, MistakesNameFileAndField) {
  EXPECT_FALSE(mistake_for_pages({folder_ / "hall.json", {}, {}}));
  EXPECT_EQ(mistake(""), "");
  EXPECT_THAT(mistake(R"(, "titel": "Door")"), StartsWith("tours[0].stops[0]: "));
  EXPECT_THAT(mistake_in("{ broken"), StartsWith("byte "));
}

TEST_F(ToursOnDisk, MediaOfAnySiteNeedHttps) {
  EXPECT_EQ(mistake(R"(, "media": [{"src": "https://media.example/a.mp4"}])"), "");
  EXPECT_THAT(mistake(R"(, "media": [{"src": "http://media.example/a.mp4"}])"),
              StartsWith("tours[0].stops[0].media[0].src: "));
}

TEST_F(ToursOnDisk, VoicesAndFilmsMayBeOthersInALanguage) {
  const auto voice = [&](const std::string& translations) {
    return mistake(R"(, "narration": {"src": "a.mp3", "translations": )" + translations + "}");
  };
  EXPECT_EQ(
      voice(R"({"de": {"src": "de.ogg", "captions": "de.vtt"}, "fr": {"captions": "f.vtt"}})"), "");
  const std::string at = "tours[0].stops[0].narration.translations";
  EXPECT_THAT(voice(R"({"de": {"src": "de.mp4"}})"), StartsWith(at + ".de.src: is no sound"));
  EXPECT_THAT(voice(R"({"de": {"src": "../a.mp3"}})"), StartsWith(at + ".de.src: "));
  EXPECT_THAT(voice(R"({"de": {"captions": "a.txt"}})"), StartsWith(at + ".de.captions: "));
  EXPECT_THAT(voice(R"({"de": {"type": "audio"}})"), StartsWith(at + ".de: "));
  EXPECT_THAT(voice(R"({"de": {"title": "a"}})"), StartsWith(at + ".de: unknown field"));
  EXPECT_THAT(voice(R"({"d_e": {}})"), StartsWith(at + ": 'd_e' is no language"));
  EXPECT_EQ(
      mistake(R"(, "media": [{"src": "a.mp4", "translations": {"de": {"captions": "a.vtt"}}}])"),
      "");
  EXPECT_THAT(
      mistake(R"(, "media": [{"src": "a.mp4", "translations": {"de": {"captions": "a"}}}])"),
      StartsWith("tours[0].stops[0].media[0].translations.de.captions: "));
  const auto sound = [&](const std::string& translations) {
    return mistake_in(R"({"tours": [{"stops": [], "sound": {"src": "a.mp3", "translations": )" +
                      translations + "}}]}");
  };
  EXPECT_EQ(sound(R"({"de": {"src": "de.ogg"}})"), "");
  EXPECT_THAT(sound(R"({"de": {"captions": "a.vtt"}})"),
              StartsWith("tours[0].sound.translations.de: unknown field"));
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
