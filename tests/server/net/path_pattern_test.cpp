#include "server/net/path_pattern.h"

#include "tests/support/test.h"

namespace catgs::test {
namespace {

TEST(PathPattern, TextMatchesItselfAlone) {
  EXPECT_TRUE(match_path("/api/scenes", "/api/scenes"));
  for (const char* path : {"", "/api/scene", "/api/scenes/", "x/api/scenes"})
    EXPECT_FALSE(match_path("/api/scenes", path)) << path;
}

TEST(PathPattern, NameTakesOneSegment) {
  EXPECT_EQ(match_path("/films/{job}/file", "/films/ab/file").value()[0], "ab");
  for (const char* path : {"/films//file", "/films/a/b/file", "/films/file", "/films/ab/files"})
    EXPECT_FALSE(match_path("/films/{job}/file", path)) << path;
}

TEST(PathPattern, NameWithDotsTakesSlashes) {
  const auto parts = match_path("/scenes/{scene...}/tours", "/scenes/a/tours/b/tours");
  EXPECT_EQ(parts.value()[0], "a/tours/b");
  EXPECT_FALSE(match_path("/scenes/{scene...}/tours", "/scenes//tours"));
  EXPECT_FALSE(match_path("/scenes/{scene...}/tours", "/scenes/tours"));
}

TEST(PathPattern, NameWithQuestionMarkMayBeEmpty) {
  constexpr std::string_view pattern = "/scenes/{scene...}/media/{name?}";
  EXPECT_EQ(match_path(pattern, "/scenes/a/media/").value(), (PathParts{"a", ""}));
  EXPECT_EQ(match_path(pattern, "/scenes/a/media/b.jpg").value(), (PathParts{"a", "b.jpg"}));
  EXPECT_EQ(match_path(pattern, "/scenes/a/media/b/media/c").value(),
            (PathParts{"a/media/b", "c"}));
  for (const char* path : {"/scenes/a/media", "/scenes/a/media/b/c", "/scenes//media/b"})
    EXPECT_FALSE(match_path(pattern, path)) << path;
}

}  // namespace
}  // namespace catgs::test
