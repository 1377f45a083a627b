#include "render_core/scene/files/tour_titles.h"

#include <gtest/gtest.h>

namespace catgs {
namespace {

TEST(TitlesOfTours, AreThoseOfTheSidecarOrNone) {
  const auto titles =
      titles_of_tours(R"({"tours":[{"title":"Empty","stops":[]},)"
                      R"({"title":"House","stops":[{"title":"Gate"},{"caption":"no title"}]}]})");
  ASSERT_EQ(titles.size(), 1u) << "pages leave out tours without stops";
  EXPECT_EQ(titles[0].tour, "House");
  EXPECT_EQ(titles[0].stops, (std::vector<std::string>{"Gate", ""}));
  for (const char* other : {"", "{}", R"({"tours":null})", R"({"tours":[{"stops":5}]})",
                            R"({"tours":[5]})", "[1", "[]", R"({"settings":[]})"})
    EXPECT_TRUE(titles_of_tours(other).empty()) << other;
}

TEST(TitlesOfTours, AnnotationsCountWhereThereAreNoTours) {
  const std::string settings = R"("settings":{"annotations":[{"title":"Door"},{"title":"Bell"}]})";
  const auto imported = titles_of_tours("{\"tours\":null," + settings + "}");
  ASSERT_EQ(imported.size(), 1u);
  EXPECT_EQ(imported[0].stops, (std::vector<std::string>{"Door", "Bell"}));
  EXPECT_TRUE(titles_of_tours("{\"tours\":[]," + settings + "}").empty());
}

}  // namespace
}  // namespace catgs
