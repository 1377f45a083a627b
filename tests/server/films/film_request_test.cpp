#include "server/films/film_request.h"

#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

using testing::HasSubstr;

const std::string view = "[1, 2, 3, 0, 0, 0, 1, 60]";

std::string film(const std::string& views, const std::string& size = "[320, 180]",
                 const std::string& kind = "film") {
  return fmt::format(R"({{"kind": "{}", "size": {}, "views": [{}]}})", kind, size, views);
}

std::string mistake(const std::string& json) {
  try {
    parse_film_request(json);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(FilmRequest, RepeatsViewsAndKeepsTheFieldOfView) {
  const FilmRequest request = parse_film_request(film(view + ", 2, [4, 5, 6, 0, 0, 0, 1], 1"));
  ASSERT_EQ(request.views.size(), 5u);
  EXPECT_EQ(request.size_px, glm::ivec2(320, 180));
  EXPECT_EQ(request.views[2].world_from_camera.position, glm::vec3(1, 2, 3));
  EXPECT_EQ(request.views[4].world_from_camera.position, glm::vec3(4, 5, 6));
  EXPECT_NEAR(request.views[4].fov_y_rad, 1.0471976f, 1e-6f);
}

TEST(FilmRequest, LastsTenMinutesAtMost) {
  EXPECT_EQ(parse_film_request(film(view + ", 17999")).views.size(), most_film_frames);
  EXPECT_THAT(mistake(film(view + ", 18000")), HasSubstr("views: has more than 18000 views"));
  EXPECT_THAT(mistake(film(view + ", 4294967295")), HasSubstr("views: has more than 18000"));
  EXPECT_THAT(mistake(film(view + ", 1", "[320, 180]", "picture")),
              HasSubstr("views: has more than 1 view ("));
}

TEST(FilmRequest, HasASizeThatItsKindMayHave) {
  EXPECT_EQ(mistake(film(view, "[7680, 4320]", "picture")), "");
  EXPECT_EQ(mistake(film(view, "[8192, 4096]", "panorama")), "");
  EXPECT_THAT(mistake(film(view, "[7682, 4320]", "picture")), HasSubstr("between 16x16 and"));
  EXPECT_THAT(mistake(film(view, "[4096, 4096]", "panorama")), HasSubstr("twice as wide as high"));
  EXPECT_THAT(mistake(film(view, "[3840, 2160]")), HasSubstr("between 16x16 and"));
  EXPECT_THAT(mistake(film(view, "[321, 180]")), HasSubstr("size: has an odd side"));
  EXPECT_THAT(mistake(film(view, "[-1, 180]")), HasSubstr("size"));
  EXPECT_THAT(mistake(film(view, "[320]")), HasSubstr("size: is not width and height"));
}

TEST(FilmRequest, NamesTheFieldThatIsWrong) {
  EXPECT_THAT(mistake("{ broken"), HasSubstr("film: byte "));
  EXPECT_THAT(mistake("7"), HasSubstr("is not an object"));
  EXPECT_THAT(mistake(film(view, "[320, 180]", "opera")), HasSubstr("kind: is no kind"));
  EXPECT_THAT(mistake(film("")), HasSubstr("views: is empty"));
  EXPECT_THAT(mistake(film("7")), HasSubstr("views[0]"));
  EXPECT_THAT(mistake(film("[1, 2, 3, 0, 0, 0, 1]")), HasSubstr("views[0]: is not [x, y, z"));
  EXPECT_THAT(mistake(film("[1, 2, 3, 0, 0, 0, 0, 60]")), HasSubstr("views[0]: is no quaternion"));
  EXPECT_THAT(mistake(film("[1, 2, 3, 0, 0, 0, 1.02, 60]")), HasSubstr("is no quaternion"));
  EXPECT_THAT(mistake(film("[1, 2, 3, 0, 0, 0, 1, 170]")), HasSubstr("field of view"));
  EXPECT_THAT(mistake(film("[1, 2, 3e9, 0, 0, 0, 1, 60]")),
              HasSubstr("views[0]: is not a position"));
  EXPECT_THAT(mistake(film("[1, 2, \"x\", 0, 0, 0, 1, 60]")), HasSubstr("views[0][2]"));
  EXPECT_THAT(mistake(film(view + ", 1.5")), HasSubstr("views[1]"));
  EXPECT_THAT(mistake(film(view + ", -1")), HasSubstr("views[1]"));
}

}  // namespace
}  // namespace catgs
