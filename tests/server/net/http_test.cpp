#include "server/net/http.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/error.h"
#include "server/net/static_files.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using testing::HasSubstr;

TEST(Origin, OwnPagesAndListedOnesMayConnect) {
  EXPECT_TRUE(origin_allowed("", "a.example", {})) << "no browser";
  EXPECT_TRUE(origin_allowed("https://a.example", "a.example", {}));
  EXPECT_TRUE(origin_allowed("http://a.example:8080", "a.example:8080", {}));
  EXPECT_FALSE(origin_allowed("http://a.example:8081", "a.example:8080", {}));
  EXPECT_FALSE(origin_allowed("https://evil.example", "a.example", {}));
  EXPECT_FALSE(origin_allowed("https://a.example.evil.example", "a.example", {}));
  EXPECT_FALSE(origin_allowed("null", "a.example", {}));
  EXPECT_TRUE(origin_allowed("https://b.example", "a.example", {"https://b.example"}));
  EXPECT_TRUE(origin_allowed("null", "a.example", {"*"}));
}

TEST(ContentSecurityPolicy, NamesWhoMayEmbed) {
  EXPECT_THAT(content_security_policy({}), HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(content_security_policy({"https://museum.example"}),
              HasSubstr("frame-ancestors https://museum.example"));
}

TEST(StaticFiles, CompressesTextAndKeepsTypes) {
  const test::TemporaryFolder folder;
  folder.write("index.html", std::string(5000, 'a'));
  folder.write("assets/x.mjs", "export {}");
  const StaticFiles files(folder.path());
  const auto plain = files.respond({"/", "", false});
  EXPECT_EQ(plain.body->size(), 5000u);
  EXPECT_FALSE(plain.gzip);
  const auto zipped = files.respond({"/index.html", "", true});
  EXPECT_TRUE(zipped.gzip);
  EXPECT_LT(zipped.body->size(), 500u);
  EXPECT_EQ(zipped.etag, plain.etag);
  EXPECT_EQ(files.respond({"/", plain.etag, true}).status, 304);
  EXPECT_THAT(files.respond({"/assets/x.mjs", "", true}).content_type,
              HasSubstr("text/javascript"));
  EXPECT_EQ(files.respond({"/assets/../index.html", "", true}).status, 404);
  EXPECT_EQ(files.respond({"/assets", "", true}).status, 404);
}

TEST(StaticFiles, NamesAFolderThatIsNoClient) {
  EXPECT_THROW(StaticFiles("/nonexistent"), InputError);
  EXPECT_THROW(StaticFiles(std::filesystem::path("/proc/self/fdinfo")), InputError);
}

}  // namespace
}  // namespace catgs
