// Integration: pictures, films and sounds of tours. Real sockets on loopback, a whole server in
// this process.

#include <ctime>

#include <nlohmann/json.hpp>

#include "server/access/access.h"
#include "server/access/signed_token.h"
#include "server/media/media_folder.h"
#include "server/net/http.h"
#include "server/net/upload_slots.h"
#include "tests/server/media/sample_media.h"
#include "tests/server/net/own_scene_fixture.h"
#include "tests/support/raw_socket.h"

namespace catgs::test {
namespace {

std::string long_film(std::size_t bytes = 300'000) {
  std::string film = mp4_file();
  for (int i = 0; film.size() < bytes; ++i) film += fmt::format("{:07}\n", i);
  return film;
}

class Media : public OwnSceneTest {
 protected:
  static void SetUpTestSuite() {
    make_scenes();
    folder->write("revoked", "");
    server = std::make_unique<RunningServer>(configure);
  }
  static void configure(ServerConfig& config) {
    OwnSceneTest::configure(config);
    config.revoked_links = (*folder / "revoked").string();
    config.media_origins = {"https://media.example"};
  }
  Media() {
    write("door.jpg", jpeg_file());
    write("film.mp4", film_);
  }
  void write(const std::string& name, const std::string& content) const {
    folder->write(media / name, content);
  }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(media), {}));
  }
  HttpReply get(const std::string& what, std::map<std::string, std::string> headers = {},
                const std::string& by = make_link("viewer")) {
    if (!by.empty()) headers.merge(bearer(by));
    return http_get(server->port(), path_of(what), headers);
  }
  HttpReply put(const std::string& name, const std::string& content,
                const std::string& by = make_link("author"),
                std::map<std::string, std::string> headers = {}) {
    headers.merge(bearer(by));
    return http_put(server->port(), path_of("media/" + name), content, headers);
  }
  std::string head_of_put(const std::string& by, std::size_t bytes) const {
    return OwnSceneTest::head_of_put("media/a.mp4", by, bytes);
  }

  const std::filesystem::path media = *folder / (hall + ".media");
  const std::string film_ = long_film();
};

TEST_F(Media, AreServedByTheirContentAndCanDoNothing) {
  const HttpReply whole = get("media/film.mp4");
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.body, film_) << "of several pieces";
  EXPECT_EQ(whole.headers.at("content-type"), "video/mp4");
  EXPECT_EQ(whole.headers.at("accept-ranges"), "bytes");
  EXPECT_EQ(whole.headers.at("x-content-type-options"), "nosniff");
  EXPECT_EQ(whole.headers.at("content-security-policy"), "default-src 'none'; sandbox");
  EXPECT_EQ(get("media/film.mp4", {{"if-none-match", whole.headers.at("etag")}}).status, 304);

  // A picture with a page behind it is a picture.
  write("both.html", jpeg_file() + "<script>alert(1)</script>");
  EXPECT_EQ(get("media/both.html").headers.at("content-type"), "image/jpeg");
  write("page.jpg", "<!doctype html><script>alert(1)</script>");
  write("drawing.png", "<svg xmlns='http://www.w3.org/2000/svg'/>");
  std::filesystem::create_symlink(link_key_file(), media / "link.jpg");
  for (const char* name : {"page.jpg", "drawing.png", "link.jpg", "absent.jpg", "..%2fkey", "",
                           "%2e%2e/key", ".hidden"})
    EXPECT_EQ(get(std::string("media/") + name).status, 404) << name;
  for (const char* path :
       {"/api/scenes/garden/media/door.jpg", "/api/scenes/absent/media/door.jpg"})
    EXPECT_EQ(http_get(server->port(), path, bearer(make_link("viewer"))).status, 404) << path;
}

TEST_F(Media, AnswerRangesOfBytes) {
  const auto part = [&](const std::string& range, std::map<std::string, std::string> more = {}) {
    more["range"] = range;
    return get("media/film.mp4", more);
  };
  const std::string size = std::to_string(film_.size());
  const HttpReply middle = part("bytes=70000-200000");
  EXPECT_EQ(middle.status, 206);
  EXPECT_EQ(middle.headers.at("content-range"), "bytes 70000-200000/" + size);
  EXPECT_EQ(middle.body, film_.substr(70'000, 130'001));
  EXPECT_EQ(part("bytes=-5").body, film_.substr(film_.size() - 5));
  const HttpReply behind = part("bytes=" + size + "-");
  EXPECT_EQ(behind.status, 416);
  EXPECT_EQ(behind.headers.at("content-range"), "bytes */" + size);
  EXPECT_EQ(part("bytes=0-1,4-5").status, 200);
  const std::string tag = middle.headers.at("etag");
  EXPECT_EQ(part("bytes=0-1", {{"if-range", tag}}).status, 206);
  EXPECT_EQ(part("bytes=0-1", {{"if-range", "\"another\""}}).status, 200);

  for (const std::string range : {"", "Range: bytes=0-4\r\n"}) {
    const std::string head = "HEAD " + path_of("media/film.mp4") +
                             " HTTP/1.1\r\nHost: 127.0.0.1\r\n" + "Authorization: Bearer " +
                             make_link("viewer") + "\r\n" + range + "\r\n";
    EXPECT_THAT(raw_answer(server->port(), head),
                AllOf(StartsWith("HTTP/1.1 200 "), HasSubstr("content-length: " + size),
                      EndsWith("\r\n\r\n")));
  }
}

TEST_F(Media, FollowersWithoutALinkGetTheMediaOfTheirGuidesSceneAlone) {
  WireClient guide(server->port());
  const std::string watch = guide.greet(hello_by(make_link("viewer", hall), hall)).watch_token();
  guide.present();
  v1::ClientMessage hello = hello_by({});
  hello.mutable_hello()->set_watch(watch);
  hello.mutable_hello()->set_follow(true);
  WireClient follower(server->port());
  const std::string pass = "?pass=" + follower.greet(hello).scene_pass();
  const std::string file = path_of("media/door.jpg"), other = "/api/scenes/hall0/media/door.jpg";
  const std::pair<std::string, int> cases[] = {{file + pass, 200},
                                               {path_of("tours") + pass, 200},
                                               {path_of("media/absent.jpg") + pass, 404},
                                               {file, 401},
                                               {file + "?pass=", 401},
                                               {file + pass + "x", 401},
                                               {other + pass, 401},
                                               {path_of("media") + pass, 401},
                                               {path_of("poster.jpg") + pass, 401}};
  for (const auto& [path, status] : cases)
    EXPECT_EQ(http_get(server->port(), path).status, status) << path;
  EXPECT_EQ(http_get(server->port(), file + pass).body, jpeg_file());
  EXPECT_EQ(http_put(server->port(), file + pass, jpeg_file(), {}).status, 401);
}

TEST_F(Media, ClientsThatGoOrStallLoseOnlyTheirConnection) {
  const std::string film = long_film(6 << 20);
  write("long.mp4", film);
  std::vector<RawSocket> slow;
  for (int i = 0; i < 8; ++i) {
    slow.emplace_back(server->port());
    slow.back().send("GET " + path_of("media/long.mp4") + " HTTP/1.1\r\nHost: 127.0.0.1\r\n" +
                     "Authorization: Bearer " + make_link("viewer") + "\r\n\r\nmore");
  }
  EXPECT_EQ(get("media/film.mp4").body, film_);
  slow.clear();
  EXPECT_EQ(get("media/long.mp4").body, film);
}

TEST_F(Media, NeedALinkOrAPassOfTheScene) {
  const std::string file = "media/door.jpg";
  const auto by_pass = [&](const std::string& what, const std::string& pass) {
    return get(what + "?pass=" + pass, {}, "").status;
  };
  EXPECT_EQ(get(file, {}, "").status, 401);
  EXPECT_EQ(get(file).status, 200);
  EXPECT_EQ(get(file, {}, make_link("viewer", "garden")).status, 401);
  EXPECT_EQ(get("media-pass", {}, "").status, 401);

  const std::string pass = get("media-pass", {}, make_link("viewer", hall, "12ab")).body;
  EXPECT_EQ(by_pass(file, pass), 200);
  EXPECT_EQ(by_pass(file, pass + "x"), 401);
  EXPECT_EQ(by_pass(file, ""), 401);
  EXPECT_EQ(by_pass(file, make_link("viewer")), 401) << "a link is no pass";
  EXPECT_EQ(by_pass("tours", pass), 200);
  EXPECT_THAT(get("tours?pass=" + pass, {}, "").body, HasSubstr(R"("may_save":false)"));
  EXPECT_EQ(by_pass("walk", pass), 401) << "it is good for tours and media alone";
  EXPECT_EQ(by_pass("media", pass), 401);
  EXPECT_EQ(http_get(server->port(), "/api/scenes/garden/media/door.jpg?pass=" + pass).status, 401);
  EXPECT_EQ(get("tours", {}, pass).status, 401);

  const std::int64_t soon = std::time(nullptr) + 600;
  const std::string key = read_key_file("", link_key_file());
  const std::string brief =
      get("media-pass", {}, make_link_token({hall, "viewer", soon, "34cd"}, key)).body;
  EXPECT_EQ(by_pass(file, brief), 200);
  EXPECT_THAT(read_signed_token("catgs-media-v1", brief, key),
              Optional(HasSubstr(fmt::format("\n{}\n", soon))))
      << "it ends with its link";

  folder->write("revoked", "12ab\n");
  EXPECT_TRUE(eventually([&] { return by_pass(file, pass) == 401; }));
}

TEST_F(Media, PassEndsWithItsStaticToken) {
  const auto tokens = folder->write("tokens", "alpha-alpha\nbeta-beta\n");
  const RunningServer other([&](ServerConfig& config) {
    config.scenes = {(*folder / (hall + ".ply")).string()};
    config.token_file = tokens.string();
  });
  const auto pass_of = [&](const char* token) {
    return http_get(other.port(), path_of("media-pass"), bearer(token)).body;
  };
  const std::string alpha = pass_of("alpha-alpha"), beta = pass_of("beta-beta");
  const auto status = [&](const std::string& pass) {
    return http_get(other.port(), path_of("media/door.jpg?pass=" + pass)).status;
  };
  EXPECT_EQ(status(alpha), 200);
  folder->write("tokens", "beta-beta\n");
  EXPECT_TRUE(eventually([&] { return status(alpha) == 401; }));
  EXPECT_EQ(status(beta), 200);
}

TEST_F(Media, AreListedForAuthors) {
  EXPECT_EQ(get("media", {}, "").status, 401);
  EXPECT_EQ(get("media").status, 403);
  const auto list = nlohmann::json::parse(get("media", {}, make_link("author")).body)["media"];
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0]["name"], "door.jpg");
  EXPECT_EQ(list[0]["type"], "image/jpeg");
  EXPECT_EQ(list[1]["bytes"], film_.size());
}

TEST_F(Media, AreAddedByAuthors) {
  const std::string film = long_film(3 << 20), author = make_link("author");
  HttpReply saved;  // an earlier test's slot may be freed a little later
  ASSERT_TRUE(eventually([&] { return (saved = put("new.mp4", film)).status != 503; }));
  EXPECT_EQ(saved.status, 200) << saved.body;
  EXPECT_EQ(get("media/new.mp4").body, film);
  EXPECT_EQ(put("new.mp4", film, author, {{"if-none-match", "*"}}).status, 412);
  EXPECT_EQ(put("new.mp4", film_).status, 200);
  EXPECT_EQ(get("media/new.mp4").body, film_);

  for (const char* role : {"viewer", "solo", "spectator"})
    EXPECT_EQ(put("other.jpg", jpeg_file(), make_link(role)).status, 403) << role;
  EXPECT_EQ(put("other.jpg", jpeg_file(), "guess").status, 401);
  EXPECT_EQ(put("other.jpg", jpeg_file(), author, {{"origin", "https://evil.example"}}).status,
            403);
  EXPECT_FALSE(std::filesystem::exists(media / "other.jpg"));
}

TEST_F(Media, ServersOverOneFolderShareFilesAndPasses) {
  const RunningServer other(configure);
  EXPECT_EQ(put("new.mp4", film_).status, 200);
  const std::string path = path_of("media/new.mp4");
  auto only_a_new_one = bearer(make_link("author"));
  const HttpReply there = http_get(other.port(), path, only_a_new_one);
  EXPECT_EQ(there.body, film_);
  EXPECT_EQ(there.headers.at("etag"), get("media/new.mp4").headers.at("etag"));
  const std::string pass = get("media-pass").body;
  EXPECT_EQ(http_get(other.port(), path + "?pass=" + pass).status, 200);
  only_a_new_one["if-none-match"] = "*";
  EXPECT_EQ(http_put(other.port(), path, film_, only_a_new_one).status, 412);
}

TEST_F(Media, AreCheckedBeforeTheyAreKept) {
  struct Refused {
    std::string name, content;
    int status;
  };
  for (const auto& [name, content, status] :
       {Refused{"a.jpg", "<html>", 409}, Refused{"a.svg", "<svg/>", 400},
        Refused{"a.png", jpeg_file(), 409}, Refused{"a.png", png_file(100'000, 1), 409},
        Refused{".a.jpg", jpeg_file(), 400}}) {
    const HttpReply reply = put(name, content);
    EXPECT_EQ(reply.status, status) << name << ": " << reply.body;
    EXPECT_THAT(reply.body, Not(HasSubstr(folder->path().string())));
  }
  EXPECT_THAT(put("..%2fa.jpg", jpeg_file()).status, AnyOf(400, 404, 405));
  EXPECT_EQ(http_put(server->port(), "/api/scenes/garden/media/a.jpg", jpeg_file(),
                     bearer(make_link("author")))
                .status,
            409);
  EXPECT_THAT(raw_answer(server->port(), head_of_put(make_link("author"), max_media_bytes + 1)),
              StartsWith("HTTP/1.1 413 "));
  EXPECT_EQ(files(), 2u);
}

/// They are in memory until they are on the disk.
TEST_F(Media, LargeUploadsAreTakenOneAtATime) {
  const auto begin = [&](const std::string& by) {
    RawSocket slow(server->port());
    slow.send(head_of_put(by, max_media_bytes) + film_);
    return slow;
  };
  const std::string film = long_film(max_upload_bytes + 1), author = make_link("author");
  std::vector<RawSocket> slow;  // silent ones are hung up on
  ASSERT_TRUE(eventually([&] {
    slow.push_back(begin(author));
    return put("b.mp4", film).status == 503;
  })) << "one of a link";
  EXPECT_EQ(put("b.jpg", jpeg_file()).status, 200) << "small ones have other slots";
  ASSERT_TRUE(eventually([&] {
    slow.push_back(begin(author));
    slow.push_back(begin(make_link("author", "", "22")));
    return put("b.mp4", film, make_link("author", "", "33")).status == 503;
  })) << "and one of an address";
  slow.clear();
  EXPECT_TRUE(eventually([&] { return put("b.mp4", film).status == 200; }));
}

/// A byte now and then would otherwise hold it for nine minutes.
TEST_F(Media, DrippedUploadGivesItsPlaceBack) {
  const std::string film = long_film(max_upload_bytes + 1);
  RawSocket drip(server->port());
  drip.send(head_of_put(make_link("author"), max_media_bytes));
  const auto status = [&] {
    drip.send("x");
    return put("b.mp4", film).status;
  };
  ASSERT_TRUE(eventually([&] { return status() == 503; }));
  EXPECT_TRUE(eventually([&] { return status() == 200; }));
}

/// libwebsockets takes such segments out of a path before the server sees it.
TEST_F(Media, EmptyAndDotSegmentsLeadWhereThePathWithoutThemDoes) {
  const auto by_author = bearer(make_link("author"));
  const int port = server->port();
  for (const std::string form :
       {"/api/scenes/{}/media//door.jpg", "/api/scenes/{}/media/%2fdoor.jpg",
        "/api/scenes/{}//media/door.jpg", "/api//scenes/./{}/media/door.jpg",
        "//api/scenes/{}/media/film.mp4/../door.jpg"}) {
    const std::string path = fmt::format(fmt::runtime(form), hall);
    EXPECT_EQ(http_get(port, path).status, 401) << path;
    EXPECT_EQ(http_get(port, path, by_author).body, jpeg_file()) << path;
    EXPECT_EQ(http_put(port, path, jpeg_file(), {}).status, 401) << path;
    EXPECT_EQ(http_put(port, path, jpeg_file(), by_author).status, 200) << path;
  }
  for (const std::string& path :
       {std::string("/api/scenes//media/door.jpg"), std::string("/api/scenes/./media/door.jpg"),
        std::string("/api/scenes//tours"), path_of("media//"), path_of("media/."),
        path_of("media/door.jpg/."), std::string("/api/films//file")}) {
    EXPECT_EQ(http_get(port, path, by_author).status, 404) << path;
    EXPECT_THAT(http_put(port, path, jpeg_file(), by_author).status, AnyOf(400, 405)) << path;
  }
  EXPECT_EQ(files(), 3u) << "door.jpg, film.mp4 and the lock of servers that save";
}

TEST_F(Media, ToursShowFilesAndSitesThatTheOperatorNames) {
  const auto save = [&](const std::string& src) {
    return http_put(
        server->port(), path_of("sidecar"),
        fmt::format(R"({{"tours": [{{"stops": [{{"position": [0, 0, 0], "look_at": [0, 0, 1],
                        "media": [{{"src": "{}", "alt": "A door"}}]}}]}}]}})",
                    src),
        bearer(make_link("author")));
  };
  EXPECT_EQ(save("door.jpg").status, 200);
  EXPECT_EQ(save("https://media.example/door.jpg").status, 200);
  EXPECT_THAT(save("https://evil.example/door.jpg").body,
              HasSubstr("tours[0].stops[0].media[0].src: "));
  EXPECT_THAT(http_get(server->port(), "/").headers.at("content-security-policy"),
              HasSubstr("media-src 'self' https://media.example;"));
}

}  // namespace
}  // namespace catgs::test
