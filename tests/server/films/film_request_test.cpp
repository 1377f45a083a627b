#include "server/films/film_request.h"

#include <fmt/format.h>

#include "tests/support/test.h"

namespace catgs {
namespace {

const std::string view = "[1, 2, 3, 0, 0, 0, 1, 60]";

std::string film(const std::string& views, const std::string& size = "[320, 180]",
                 const std::string& kind = "film") {
  return fmt::format(R"({{"kind": "{}", "size": {}, "views": [{}]}})", kind, size, views);
}

std::string mistake(const std::string& json) {
  return test::refused_field([&] { parse_film_request(json); });
}

TEST(FilmRequest, RepeatsViewsAndKeepsTheFieldOfView) {
  const FilmRequest request = parse_film_request(film(view + ", 2, [4, 5, 6, 0, 0, 0, 1], 1"));
  ASSERT_EQ(request.views.size(), 5u);
  EXPECT_EQ(request.size_px, glm::ivec2(320, 180));
  EXPECT_EQ(request.views[2].position, glm::dvec3(1, 2, 3));
  EXPECT_EQ(request.views[4].position, glm::dvec3(4, 5, 6));
  EXPECT_NEAR(request.views[4].fov_y_rad, 1.0471976f, 1e-6f);
}

TEST(FilmRequest, OrthographicViewsHaveANinthNumber) {
  const auto views =
      parse_film_request(film("[1, 2, 3, 0, 0, 0, 1, 60, 8.5], [4, 5, 6, 0, 0, 0, 1], " + view))
          .views;
  EXPECT_EQ(views[0].view_height, 8.5f);
  EXPECT_EQ(views[1].view_height, 8.5f);
  EXPECT_EQ(views[2].view_height, 0.0f);
}

TEST(FilmRequest, MayDrawOneBoxOnly) {
  const auto boxed = [](const std::string& box) {
    return fmt::format(R"({{"kind": "picture", "size": [320, 180], "views": [{}], "box": {}}})",
                       view, box);
  };
  const auto box = parse_film_request(boxed("[1, 2, 3, 0, 0, 0, 1, 4, 5, 6]")).box;
  ASSERT_TRUE(box);
  EXPECT_EQ(box->centre, glm::dvec3(1, 2, 3));
  EXPECT_EQ(box->half_extent, glm::vec3(4, 5, 6));
  for (const char* bad : {"[1, 2, 3]", "7", "[1, 2, 3, 0, 0, 0, 1, 4, 0, 6]"})
    EXPECT_EQ(mistake(boxed(bad)), "box") << bad;
}

TEST(FilmRequest, LastsTenMinutesAtMost) {
  EXPECT_EQ(parse_film_request(film(view + ", 17999")).views.size(), most_film_frames);
  for (const char* frames : {", 18000", ", 4294967295"})
    EXPECT_EQ(mistake(film(view + frames)), "views") << frames;
  EXPECT_EQ(mistake(film(view + ", 1", "[320, 180]", "picture")), "views") << "it has one";
}

TEST(FilmRequest, HasASizeThatItsKindMayHave) {
  struct Case {
    const char *kind, *size, *field;
  };
  for (const auto& [kind, size, field] :
       {Case{"picture", "[7680, 4320]", ""}, Case{"panorama", "[8192, 4096]", ""},
        Case{"picture", "[7682, 4320]", "size"}, Case{"panorama", "[4096, 4096]", "size"},
        Case{"film", "[3840, 2160]", "size"}, Case{"film", "[321, 180]", "size"},
        Case{"film", "[-1, 180]", "size[0]"}, Case{"film", "[320]", "size"}})
    EXPECT_EQ(mistake(film(view, size, kind)), field) << kind << " " << size;
}

TEST(FilmRequest, NamesTheFieldThatIsWrong) {
  EXPECT_THAT(mistake("{ broken"), StartsWith("byte "));
  EXPECT_EQ(mistake("7"), "film");
  EXPECT_EQ(mistake(film(view, "[320, 180]", "opera")), "kind");
  EXPECT_EQ(mistake(film("")), "views");
  for (const char* bad : {"7", "[1, 2, 3, 0, 0, 0, 1]", "[1, 2, 3, 0, 0, 0, 0, 60]",
                          "[1, 2, 3, 0, 0, 0, 1.02, 60]", "[1, 2, 3, 0, 0, 0, 1, 170]",
                          "[1, 2, 3, 0, 0, 0, 1, 60, 0]", "[1, 2, 3e9, 0, 0, 0, 1, 60]"})
    EXPECT_EQ(mistake(film(bad)), "views[0]") << bad;
  EXPECT_EQ(mistake(film("[1, 2, \"x\", 0, 0, 0, 1, 60]")), "views[0][2]");
  for (const char* bad : {", 1.5", ", -1"}) EXPECT_EQ(mistake(film(view + bad)), "views[1]") << bad;
}

}  // namespace
}  // namespace catgs
