// Integration: pictures, films and sounds of tours. Real sockets on loopback, a whole server in
// this process.

#include <ctime>
#include <filesystem>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/files/save_scene.h"
#include "render_core/synth/synth.h"
#include "server/access/access.h"
#include "server/access/signed_token.h"
#include "server/media/media_folder.h"
#include "server/net/http.h"
#include "server/net/upload_places.h"
#include "tests/server/media/sample_media.h"
#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::Optional;

class Media : public testing::Test {
 protected:
  Media() : key_file(folder.write("key", std::string(32, 'k'))) {
    save_scene(synthesize(SynthKind::city, 2000, 1).cloud, folder / "hall.ply");
    folder.write("hall.media/door.jpg", jpeg_file());
    std::string film = mp4_file();
    for (int i = 0; film.size() < 300'000; ++i) film += fmt::format("{:07}\n", i);
    folder.write("hall.media/film.mp4", film_ = film);
  }
  void start(bool with_tokens) {
    server.emplace([&](ServerConfig& config) { configure(config, with_tokens); });
  }
  void configure(ServerConfig& config, bool with_tokens) const {
    config.scenes = {(folder / "hall.ply").string(), "synth:garden:2000"};
    if (with_tokens) config.token_key_file = key_file.string();
    if (with_tokens) config.revoked_links = folder.write("revoked", "").string();
    config.media_origins = {"https://media.example"};
  }
  [[nodiscard]] std::string token(const std::string& role, const std::string& of = "",
                                  const std::string& id = "") const {
    return make_link_token({of, role, 1'000'000'000'000, id}, read_key_file("", key_file));
  }
  HttpReply get(const std::string& what, std::map<std::string, std::string> headers = {},
                const std::string& by = "") {
    if (!by.empty()) headers["authorization"] = "Bearer " + by;
    return http_get(server->port(), "/api/scenes/hall/" + what, headers);
  }
  HttpReply put(const std::string& name, const std::string& content, const std::string& by,
                std::map<std::string, std::string> headers = {}) {
    headers["authorization"] = "Bearer " + by;
    return http_put(server->port(), "/api/scenes/hall/media/" + name, content, headers);
  }

  const TemporaryFolder folder;
  const std::filesystem::path key_file;
  std::string film_;
  std::optional<RunningServer> server;
};

TEST_F(Media, AreServedByTheirContentAndCanDoNothing) {
  start(false);
  const HttpReply whole = get("media/film.mp4");
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.body, film_) << "of several pieces";
  EXPECT_EQ(whole.headers.at("content-type"), "video/mp4");
  EXPECT_EQ(whole.headers.at("accept-ranges"), "bytes");
  EXPECT_EQ(whole.headers.at("x-content-type-options"), "nosniff");
  EXPECT_EQ(whole.headers.at("content-security-policy"), "default-src 'none'; sandbox");
  EXPECT_EQ(get("media/film.mp4", {{"if-none-match", whole.headers.at("etag")}}).status, 304);

  // A picture with a page behind it is a picture.
  folder.write("hall.media/both.html", jpeg_file() + "<script>alert(1)</script>");
  EXPECT_EQ(get("media/both.html").headers.at("content-type"), "image/jpeg");
  folder.write("hall.media/page.jpg", "<!doctype html><script>alert(1)</script>");
  folder.write("hall.media/drawing.png", "<svg xmlns='http://www.w3.org/2000/svg'/>");
  std::filesystem::create_symlink(key_file, folder / "hall.media/link.jpg");
  for (const char* name : {"page.jpg", "drawing.png", "link.jpg", "absent.jpg", "..%2fkey", "",
                           "%2e%2e/key", ".hidden"})
    EXPECT_EQ(get(std::string("media/") + name).status, 404) << name;
  EXPECT_EQ(http_get(server->port(), "/api/scenes/garden/media/door.jpg").status, 404);
  EXPECT_EQ(http_get(server->port(), "/api/scenes/absent/media/door.jpg").status, 404);
}

TEST_F(Media, AnswerRangesOfBytes) {
  start(false);
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

  RawSocket head(server->port());
  head.send("HEAD /api/scenes/hall/media/film.mp4 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
  const std::string answer = head.receive(std::chrono::milliseconds(500));
  EXPECT_THAT(answer, HasSubstr("content-length: " + size));
  EXPECT_TRUE(answer.ends_with("\r\n\r\n"));
  RawSocket part_of_head(server->port());
  part_of_head.send(
      "HEAD /api/scenes/hall/media/film.mp4 HTTP/1.1\r\nHost: 127.0.0.1\r\nRange: bytes=0-4\r\n"
      "\r\n");
  EXPECT_THAT(part_of_head.receive(std::chrono::milliseconds(500)),
              AllOf(HasSubstr(" 200 "), HasSubstr("content-length: " + size)));
}

TEST_F(Media, ClientsThatGoOrStallLoseOnlyTheirConnection) {
  start(false);
  std::string film = film_;
  film.resize(6 << 20, 'x');
  folder.write("hall.media/long.mp4", film);
  std::vector<RawSocket> slow;
  for (int i = 0; i < 8; ++i) {
    slow.emplace_back(server->port());
    slow.back().send("GET /api/scenes/hall/media/long.mp4 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nmore");
  }
  EXPECT_EQ(get("media/film.mp4").body, film_);
  slow.clear();
  EXPECT_EQ(get("media/long.mp4").body, film);
}

TEST_F(Media, NeedALinkOrAPassOfTheScene) {
  start(true);
  const std::string file = "media/door.jpg";
  EXPECT_EQ(get(file).status, 401);
  EXPECT_EQ(get(file, {}, token("viewer")).status, 200);
  EXPECT_EQ(get(file, {}, token("viewer", "garden")).status, 401);
  EXPECT_EQ(get("media-pass").status, 401);

  const std::string pass = get("media-pass", {}, token("viewer", "hall", "12ab")).body;
  EXPECT_EQ(get(file + "?pass=" + pass).status, 200);
  EXPECT_EQ(get(file + "?pass=" + pass + "x").status, 401);
  EXPECT_EQ(get(file + "?pass=").status, 401);
  EXPECT_EQ(get(file + "?pass=" + token("viewer")).status, 401) << "a link is no pass";
  EXPECT_EQ(get("tours?pass=" + pass).status, 401) << "it is good for media alone";
  EXPECT_EQ(get("media?pass=" + pass).status, 401);
  EXPECT_EQ(http_get(server->port(), "/api/scenes/garden/media/door.jpg?pass=" + pass).status, 401);
  EXPECT_EQ(get("tours", {}, pass).status, 401);

  const std::int64_t soon = std::time(nullptr) + 600;
  const std::string key = read_key_file("", key_file);
  const std::string brief =
      get("media-pass", {}, make_link_token({"hall", "viewer", soon, "34cd"}, key)).body;
  EXPECT_EQ(get(file + "?pass=" + brief).status, 200);
  EXPECT_THAT(read_signed_token("catgs-media-v1", brief, key),
              Optional(HasSubstr(fmt::format("\n{}\n", soon))))
      << "it ends with its link";

  folder.write("revoked", "12ab\n");
  EXPECT_TRUE(eventually([&] { return get(file + "?pass=" + pass).status == 401; }));
}

TEST_F(Media, PassEndsWithItsStaticToken) {
  const auto tokens = folder.write("tokens", "alpha-alpha\nbeta-beta\n");
  server.emplace([&](ServerConfig& config) {
    config.scenes = {(folder / "hall.ply").string()};
    config.token_file = tokens.string();
  });
  const std::string alpha = get("media-pass", {}, "alpha-alpha").body;
  const std::string beta = get("media-pass", {}, "beta-beta").body;
  const auto status = [&](const std::string& pass) {
    return get("media/door.jpg?pass=" + pass).status;
  };
  EXPECT_EQ(status(alpha), 200);
  folder.write("tokens", "beta-beta\n");
  EXPECT_TRUE(eventually([&] { return status(alpha) == 401; }));
  EXPECT_EQ(status(beta), 200);
}

TEST_F(Media, AreListedForAuthors) {
  start(true);
  EXPECT_EQ(get("media").status, 401);
  EXPECT_EQ(get("media", {}, token("viewer")).status, 403);
  const auto list = nlohmann::json::parse(get("media", {}, token("author")).body)["media"];
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0]["name"], "door.jpg");
  EXPECT_EQ(list[0]["type"], "image/jpeg");
  EXPECT_EQ(list[1]["bytes"], film_.size());
}

TEST_F(Media, AreAddedByAuthors) {
  start(true);
  const std::string author = token("author");
  std::string film = film_;
  film.resize(3 << 20, 'x');
  const HttpReply saved = put("new.mp4", film, author);
  EXPECT_EQ(saved.status, 200) << saved.body;
  EXPECT_EQ(get("media/new.mp4", {}, author).body, film);
  EXPECT_EQ(put("new.mp4", film, author, {{"if-none-match", "*"}}).status, 412);
  EXPECT_EQ(put("new.mp4", film_, author).status, 200);
  EXPECT_EQ(get("media/new.mp4", {}, author).body, film_);

  for (const char* role : {"viewer", "solo", "spectator"})
    EXPECT_EQ(put("other.jpg", jpeg_file(), token(role)).status, 403) << role;
  EXPECT_EQ(put("other.jpg", jpeg_file(), "guess").status, 401);
  EXPECT_EQ(put("other.jpg", jpeg_file(), author, {{"origin", "https://evil.example"}}).status,
            403);
  EXPECT_FALSE(std::filesystem::exists(folder / "hall.media/other.jpg"));
}

TEST_F(Media, ServersOverOneFolderShareFilesAndPasses) {
  start(true);
  const RunningServer other([&](ServerConfig& config) { configure(config, true); });
  const std::string author = token("author");
  EXPECT_EQ(put("new.mp4", film_, author).status, 200);
  const std::string path = "/api/scenes/hall/media/new.mp4";
  const std::map<std::string, std::string> by_author{{"authorization", "Bearer " + author}};
  const HttpReply there = http_get(other.port(), path, by_author);
  EXPECT_EQ(there.body, film_);
  EXPECT_EQ(there.headers.at("etag"), get("media/new.mp4", {}, author).headers.at("etag"));
  const std::string pass = get("media-pass", {}, token("viewer")).body;
  EXPECT_EQ(http_get(other.port(), path + "?pass=" + pass).status, 200);
  auto only_a_new_one = by_author;
  only_a_new_one["if-none-match"] = "*";
  EXPECT_EQ(http_put(other.port(), path, film_, only_a_new_one).status, 412);
}

TEST_F(Media, AreCheckedBeforeTheyAreKept) {
  start(true);
  const std::string author = token("author");
  const auto refused = [&](const std::string& name, const std::string& content) {
    const HttpReply reply = put(name, content, author);
    EXPECT_NE(reply.status, 200) << name;
    EXPECT_THAT(reply.body, Not(HasSubstr(folder.path().string())));
    return reply.body;
  };
  EXPECT_THAT(refused("a.jpg", "<html>"), HasSubstr("409: a.jpg: is of no format"));
  EXPECT_THAT(refused("a.svg", "<svg/>"), HasSubstr("400: \"a.svg\" is no name of a picture"));
  EXPECT_THAT(refused("a.png", jpeg_file()), HasSubstr("its content is image/jpeg"));
  EXPECT_THAT(refused("a.png", png_file(100'000, 1)), HasSubstr("100000 x 1 pixels"));
  EXPECT_THAT(refused(".a.jpg", jpeg_file()), HasSubstr("no name"));
  EXPECT_THAT(refused("..%2fa.jpg", jpeg_file()), HasSubstr("40"));
  EXPECT_EQ(http_put(server->port(), "/api/scenes/garden/media/a.jpg", jpeg_file(),
                     {{"authorization", "Bearer " + author}})
                .status,
            409);
  RawSocket endless(server->port());
  endless.send(
      fmt::format("PUT /api/scenes/hall/media/a.mp4 HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                  "Authorization: Bearer {}\r\nContent-Length: {}\r\n\r\n",
                  author, max_media_bytes + 1));
  EXPECT_THAT(endless.receive(std::chrono::milliseconds(500)), HasSubstr(" 413 "));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / "hall.media"),
                          std::filesystem::directory_iterator()),
            2);
}

/// They are in memory until they are on the disk.
TEST_F(Media, LargeUploadsAreTakenOneAtATime) {
  start(true);
  const auto begin = [&](const std::string& by) {
    RawSocket slow(server->port());
    slow.send(
        fmt::format("PUT /api/scenes/hall/media/a.mp4 HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                    "Authorization: Bearer {}\r\nContent-Length: {}\r\n\r\n{}",
                    by, max_media_bytes, film_));
    return slow;
  };
  std::string film = film_;
  film.resize(max_upload_bytes + 1, 'x');
  const std::string author = token("author");
  std::vector<RawSocket> slow;  // silent ones are hung up on
  ASSERT_TRUE(eventually([&] {
    slow.push_back(begin(author));
    return put("b.mp4", film, author).status == 503;
  })) << "one of a link";
  EXPECT_EQ(put("b.jpg", jpeg_file(), author).status, 200) << "small ones have other places";
  ASSERT_TRUE(eventually([&] {
    slow.push_back(begin(author));
    slow.push_back(begin(token("author", "", "22")));
    return put("b.mp4", film, token("author", "", "33")).status == 503;
  })) << "and one of an address";
  slow.clear();
  EXPECT_TRUE(eventually([&] { return put("b.mp4", film, author).status == 200; }));
}

/// A byte now and then would otherwise hold it for nine minutes.
TEST_F(Media, DrippedUploadGivesItsPlaceBack) {
  start(true);
  const std::string author = token("author");
  std::string film = film_;
  film.resize(max_upload_bytes + 1, 'x');
  RawSocket drip(server->port());
  drip.send(
      fmt::format("PUT /api/scenes/hall/media/a.mp4 HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                  "Authorization: Bearer {}\r\nContent-Length: {}\r\n\r\n",
                  author, max_media_bytes));
  const auto status = [&] {
    drip.send("x");
    return put("b.mp4", film, author).status;
  };
  ASSERT_TRUE(eventually([&] { return status() == 503; }));
  EXPECT_TRUE(eventually([&] { return status() == 200; }));
}

/// libwebsockets takes such segments out of a path before the server sees it.
TEST_F(Media, EmptyAndDotSegmentsLeadWhereThePathWithoutThemDoes) {
  start(true);
  const std::string author = token("author");
  const std::string bearer = "Bearer " + author;
  for (const std::string path :
       {"/api/scenes/hall/media//door.jpg", "/api/scenes/hall/media/%2fdoor.jpg",
        "/api/scenes/hall//media/door.jpg", "/api//scenes/./hall/media/door.jpg",
        "//api/scenes/hall/media/film.mp4/../door.jpg"}) {
    EXPECT_EQ(http_get(server->port(), path).status, 401) << path;
    EXPECT_EQ(http_get(server->port(), path, {{"authorization", bearer}}).body, jpeg_file())
        << path;
    EXPECT_EQ(http_put(server->port(), path, jpeg_file(), {}).status, 401) << path;
    EXPECT_EQ(http_put(server->port(), path, jpeg_file(), {{"authorization", bearer}}).status, 200)
        << path;
  }
  for (const std::string path :
       {"/api/scenes//media/door.jpg", "/api/scenes/./media/door.jpg", "/api/scenes//tours",
        "/api/scenes/hall/media//", "/api/scenes/hall/media/.", "/api/scenes/hall/media/door.jpg/.",
        "/api/films//file"}) {
    EXPECT_EQ(http_get(server->port(), path, {{"authorization", bearer}}).status, 404) << path;
    const int status =
        http_put(server->port(), path, jpeg_file(), {{"authorization", bearer}}).status;
    EXPECT_TRUE(status == 400 || status == 405) << path << ": " << status;
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / "hall.media"),
                          std::filesystem::directory_iterator()),
            2);
}

TEST_F(Media, ToursShowFilesAndSitesThatTheOperatorNames) {
  start(true);
  const auto save = [&](const std::string& src) {
    return http_put(
        server->port(), "/api/scenes/hall/sidecar",
        fmt::format(R"({{"tours": [{{"stops": [{{"position": [0, 0, 0], "look_at": [0, 0, 1],
                        "media": [{{"src": "{}", "alt": "A door"}}]}}]}}]}})",
                    src),
        {{"authorization", "Bearer " + token("author")}});
  };
  EXPECT_EQ(save("door.jpg").status, 200);
  EXPECT_EQ(save("https://media.example/door.jpg").status, 200);
  EXPECT_THAT(save("https://evil.example/door.jpg").body,
              HasSubstr("tours[0].stops[0].media[0].src: is at no site"));
  EXPECT_THAT(http_get(server->port(), "/").headers.at("content-security-policy"),
              HasSubstr("media-src 'self' https://media.example;"));
}

}  // namespace
}  // namespace catgs::test
