#include "server/net/http.h"

#include "server/net/static_files.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

TEST(Origin, OwnPagesAndListedOnesMayConnect) {
  EXPECT_TRUE(origin_allowed("", "a.example", {})) << "no browser";
  EXPECT_TRUE(origin_allowed("https://a.example", "a.example", {}));
  EXPECT_TRUE(origin_allowed("http://a.example:8080", "a.example:8080", {}));
  EXPECT_FALSE(origin_allowed("http://a.example:8081", "a.example:8080", {}));
  EXPECT_TRUE(origin_allowed("https://a.example", "A.Example:443", {})) << "behind a proxy";
  EXPECT_TRUE(origin_allowed("http://a.example:80", "a.example", {}));
  EXPECT_FALSE(origin_allowed("http://a.example", "a.example:443", {}));
  EXPECT_FALSE(origin_allowed("https://a.example:80", "a.example", {}));
  EXPECT_FALSE(origin_allowed("https://:443", "", {}));
  EXPECT_FALSE(origin_allowed("https://evil.example", "a.example", {}));
  EXPECT_FALSE(origin_allowed("https://a.example.evil.example", "a.example", {}));
  EXPECT_FALSE(origin_allowed("null", "a.example", {}));
  EXPECT_TRUE(origin_allowed("https://b.example", "a.example", {"https://b.example"}));
  EXPECT_TRUE(origin_allowed("null", "a.example", {"*"}));
}

TEST(Precondition, IsAboutWhatIsThere) {
  const std::string tag = etag_of("a tour");
  EXPECT_NE(tag, etag_of("a tour "));
  EXPECT_THAT(tag, MatchesRegex("\"[0-9a-f]{16}\""));
  EXPECT_TRUE((Precondition{}.holds(tag)));
  EXPECT_TRUE((Precondition{}.holds("")));
  EXPECT_TRUE((Precondition{tag, ""}.holds(tag)));
  EXPECT_TRUE((Precondition{"\"x\", " + tag + " ,\"y\"", ""}.holds(tag)));
  EXPECT_FALSE((Precondition{"\"x\",,", ""}.holds(tag)));
  EXPECT_FALSE((Precondition{tag, ""}.holds(""))) << "it is gone";
  EXPECT_TRUE((Precondition{"*", ""}.holds(tag)));
  EXPECT_FALSE((Precondition{"*", ""}.holds("")));
  EXPECT_TRUE((Precondition{"", "*"}.holds("")));
  EXPECT_TRUE((Precondition{tag, "\"x\""}.holds(tag)));
  EXPECT_FALSE((Precondition{tag, tag}.holds(tag))) << "both are asked";
  EXPECT_FALSE((Precondition{"", "*"}.holds(tag))) << "somebody was first";
  EXPECT_FALSE((Precondition{"", tag}.holds(tag)));
  EXPECT_TRUE((Precondition{"", "\"x\""}.holds(tag)));
}

TEST(HostAllowed, ForeignNamesAreRefusedUnlessListed) {
  const std::vector<std::string> listed = {"https://a.example"};
  for (const Names names : {Names::loopback, Names::local}) {
    for (const char* host : {"localhost", "localhost:", "localhost:8080", "127.0.0.1",
                             "127.9.8.7:1", "[::1]", "[::1]:8080", ""})
      EXPECT_TRUE(host_allowed(host, names, {})) << host;
    for (const char* host :
         {"evil.example", "evil.example:8080", "127.evil.example", "localhost.evil", "[::", ":8080",
          "[::1", "[::1]evil.example", "[::1].evil.example", "[::1] HTTP/1.1", "127.0.0.1.",
          "localhost:80.evil.example", "localhost:80:80", "evil.", "xlocal.example", "192.168.0"})
      EXPECT_FALSE(host_allowed(host, names, listed)) << host;
    EXPECT_TRUE(host_allowed("a.example", names, listed));
    EXPECT_TRUE(host_allowed("a.example:8443", names, listed));
    EXPECT_TRUE(host_allowed("A.EXAMPLE", names, listed));
    EXPECT_TRUE(host_allowed("b.example", names, {"https://a.example", "*"}));
  }
  EXPECT_TRUE(host_allowed("evil.example", Names::all, {}));
}

TEST(HostAllowed, OnlyAServerOnALoopbackAddressIsKnownByNoOther) {
  for (const char* host : {"192.168.0.1:8080", "[2001:db8::1]:8080", "museum-pc", "museum-pc:8080",
                           "museum-pc.local", "host.docker.internal"}) {
    EXPECT_FALSE(host_allowed(host, Names::loopback, {})) << host;
    EXPECT_TRUE(host_allowed(host, Names::local, {})) << host;
  }
}

TEST(HostAllowed, LoopbackIsTheWholeNetwork127) {
  for (const char* address : {"localhost", "127.0.0.1", "127.8.9.1", "::1"})
    EXPECT_TRUE(is_loopback(address)) << address;
  for (const char* address : {"::", "0.0.0.0", "127.a.example", "10.0.0.1", "127", ""})
    EXPECT_FALSE(is_loopback(address)) << address;
  EXPECT_FALSE(is_loopback({"127.0.0.1\0.evil.example", 23})) << "its end is not at the zero byte";
}

TEST(RedirectToHttps, KeepsThePageAndNothingBreaksItsLine) {
  const HttpRequest page{
      .path = "/a b\r\nx: y", .if_none_match = {}, .arguments = {"scene=\xc3\xa9&", "author"}};
  EXPECT_EQ(redirect_to_https("[::1]:8443", page).location,
            "https://[::1]:8443/a%20b%0D%0Ax:%20y?scene=%C3%A9%26&author");
  for (const char* host : {"", "a b", "a\r\nx", "a/b", "a@b"})
    EXPECT_EQ(redirect_to_https(host, page).status, 400) << host;
}

TEST(ContentSecurityPolicy, NamesWhoMayEmbed) {
  EXPECT_THAT(content_security_policy({}), HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(content_security_policy({"https://museum.example"}),
              HasSubstr("frame-ancestors https://museum.example"));
}

TEST(ContentSecurityPolicy, NamesWhoseMediaToursShow) {
  EXPECT_THAT(content_security_policy({}),
              HasSubstr("img-src 'self' blob: data:; media-src 'self';"));
  const std::string policy =
      content_security_policy({}, {"https://a.example", "https://b.example"});
  EXPECT_THAT(policy, HasSubstr("img-src 'self' blob: data: https://a.example https://b.example;"));
  EXPECT_THAT(policy, HasSubstr("media-src 'self' https://a.example https://b.example;"));
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

TEST(StaticFiles, HaveANumberAndASize) {
  const test::TemporaryFolder many;
  many.write("index.html", "page");
  for (int i = 1; i < 4096; ++i) many.write(std::to_string(i), "");
  EXPECT_NO_THROW(StaticFiles(many.path()));
  many.write("4096", "");
  EXPECT_THROW(StaticFiles(many.path()), InputError);
  const test::TemporaryFolder large;
  const auto page = large.write("index.html", "");
  std::filesystem::resize_file(page, 268'435'457);  // without a byte on the disk
  EXPECT_THROW(StaticFiles(large.path()), InputError);
}

}  // namespace
}  // namespace catgs
