#include "server/scenes/link_preview.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

TEST(LinkPreview, NamesTitleAndPoster) {
  const std::string head = preview_elements({"https://tours.example:8443",
                                             "old hall",
                                             "The old hall",
                                             {.credits = "Ada", .licence = "CC-BY-4.0"},
                                             6'000'000,
                                             true});
  EXPECT_THAT(
      head,
      AllOf(HasSubstr(R"(<meta property="og:title" content="The old hall" />)"),
            HasSubstr(R"(content="https://tours.example:8443/api/scenes/old%20hall/poster.jpg")"),
            HasSubstr("6000000 Gaussians in your browser. Ada. CC-BY-4.0."),
            HasSubstr("summary_large_image")));
}

TEST(LinkPreview, PromisesNoPictureThatIsNotThere) {
  EXPECT_THAT(preview_elements({"https://a.example", "hall", "hall", {}, 1, false}),
              Not(HasSubstr("og:image")));
  EXPECT_THAT(preview_elements({"", "hall", "hall", {}, 1, true}), Not(HasSubstr("og:image")));
}

TEST(LinkPreview, ContainsNoMarkupOfOthers) {
  const std::string head = preview_elements(
      {"http://\"><script>a", "x\"><script>b/../c", "\"><script>c & co", {}, 1, true});
  EXPECT_THAT(head, Not(HasSubstr("<script>")));
  EXPECT_THAT(head, AllOf(HasSubstr("&quot;&gt;&lt;script&gt;c &amp; co"),
                          HasSubstr("/api/scenes/x%22%3E%3Cscript%3Eb%2F..%2Fc/poster.jpg")));
}

}  // namespace
}  // namespace catgs
