// Integration: authors save tours. Real sockets on loopback, a whole server in this process.

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "server/access/access.h"
#include "server/net/http.h"
#include "server/net/upload_slots.h"
#include "tests/server/net/own_scene_fixture.h"
#include "tests/support/raw_socket.h"

namespace catgs::test {
namespace {

constexpr std::string_view sidecar =
    R"({"up": "-y", "start_pose": {"position": [1, 2, 3], "look_at": [1, 2, 9]},
        "tours": [{"title": "Hall", "stops": [{"position": [1, 2, 3], "look_at": [0, 0, 0]}]}]})";

constexpr const char* other_sidecar = R"({"tours": [{"title": "Other", "stops": []}]})";

class SidecarUpload : public OwnSceneTest {
 protected:
  static void SetUpTestSuite() {
    make_scenes();
    start();
  }
  static void start() {
    server = std::make_unique<RunningServer>([](ServerConfig& config) {
      configure(config);
      config.allow_origins = {"https://tours.example"};
    });
  }
  std::string head(const std::string& by, std::size_t body_bytes) const {
    return head_of_put("sidecar", by, body_bytes);
  }
  HttpReply put(const std::string& by, std::map<std::string, std::string> headers = {},
                std::string_view body = sidecar) const {
    if (!by.empty()) headers.merge(bearer(by));
    return http_put(server->port(), path_of("sidecar"), std::string(body), headers);
  }
  nlohmann::json tours_as(const std::string& by) const {
    return nlohmann::json::parse(http_get(server->port(), path_of("tours"), bearer(by)).body);
  }
  float start_z() const {
    return WireClient(server->port())
        .greet(hello_by(make_link("viewer"), hall))
        .scene()
        .start_pose()
        .position()
        .z();
  }

  const std::filesystem::path file = *folder / (hall + ".json");
  const std::string author = make_link("author", "", new_link_id());  // slots are counted by link
};

TEST_F(SidecarUpload, IsInForceForTheNextVisitor) {
  const float before = start_z();
  const HttpReply reply = put(author);
  EXPECT_EQ(reply.status, 200) << reply.body;

  std::ifstream written(file);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(written), {}), sidecar);
  EXPECT_EQ(tours_as(make_link("viewer"))["document"]["tours"][0]["title"], "Hall");
  EXPECT_FLOAT_EQ(start_z(), 3.0f);
  EXPECT_NE(before, 3.0f);
}

TEST_F(SidecarUpload, IsForAuthorsAlone) {
  for (const char* role : {"viewer", "solo", "spectator"}) {
    EXPECT_EQ(put(make_link(role)).status, 403) << role;
    EXPECT_EQ(tours_as(make_link(role))["may_save"], false) << role;
  }
  EXPECT_EQ(put("").status, 401);
  EXPECT_EQ(put("guess").status, 401);
  EXPECT_EQ(put(make_link("author", "garden")).status, 401) << "a link for another scene";
  EXPECT_EQ(tours_as(author)["may_save"], true);
  EXPECT_FALSE(std::filesystem::exists(file));
}

TEST_F(SidecarUpload, ComesFromAPageOfThisServer) {
  EXPECT_EQ(put(author, {{"origin", "https://evil.example"}}).status, 403);
  EXPECT_EQ(put(author, {{"host", "evil.example"}, {"origin", "http://evil.example"}}).status, 403)
      << "a name that was made to resolve to this address";
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_EQ(put(author, {{"origin", "https://tours.example"}}).status, 200);
  const std::string own = "http://127.0.0.1:" + std::to_string(server->port());
  EXPECT_EQ(put(author, {{"origin", own}}).status, 200);
}

TEST_F(SidecarUpload, IsCheckedBeforeAnythingIsWritten) {
  const HttpReply wrong = put(author, {}, R"({"tours": [{"stops": [{"position": [0, 0]}]}]})");
  EXPECT_EQ(wrong.status, 400);
  EXPECT_THAT(wrong.body, HasSubstr("tours[0].stops[0].position"));
  EXPECT_EQ(put(author, {}, "").status, 411);
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_EQ(http_put(server->port(), "/api/scenes/absent/sidecar", "{}", bearer(author)).status,
            404);
  EXPECT_EQ(http_put(server->port(), "/index.html", "x", {}).status, 405);
}

/// The whole of it is sent before the answer is read, as browsers do.
TEST_F(SidecarUpload, IsAnsweredAndNotCutOffWhenTooLong) {
  EXPECT_EQ(put(author, {}, std::string(1 << 20, ' ')).status, 400) << "it is read";
  EXPECT_EQ(put(author, {}, std::string((1 << 20) + 1, ' ')).status, 413);
  const HttpReply refused = put(author, {}, std::string(4 * max_upload_bytes, ' '));
  EXPECT_EQ(refused.status, 413);
  EXPECT_EQ(refused.headers.at("connection"), "close");
  EXPECT_FALSE(std::filesystem::exists(file));
}

TEST_F(SidecarUpload, IsNotReadWithoutEnd) {
  const std::string piece(1 << 20, ' ');
  for (const std::string method : {"PUT", "GET", "HEAD"}) {
    RawSocket endless(server->port());
    endless.send(method + " /api/scenes/" + hall +
                 "/sidecar HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: " +
                 std::to_string(1 << 30) + "\r\n\r\n");
    int pieces = 0;
    while (pieces < 128 && endless.send(piece)) ++pieces;
    // Of an upload 16 MiB are read, and the kernel's buffers of both ends take some more.
    EXPECT_GE(pieces, method == "PUT" ? 16 : 0);
    EXPECT_LE(pieces, 28) << method;
  }
  for (const std::string length : {"99999999999999999999", "-1", "1e3"}) {
    RawSocket odd(server->port());
    odd.send("GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: " + length + "\r\n\r\n");
    EXPECT_TRUE(odd.closed_within(std::chrono::seconds(20))) << length;
  }
  EXPECT_EQ(http_get(server->port(), "/healthz").status, 200);
}

/// It once was taken for one, of a scene whose name was whatever lay in memory.
TEST_F(SidecarUpload, IsNotTheBodyOfAGet) {
  for (const std::string method : {"GET", "HEAD"}) {
    const std::string answer = raw_answer(
        server->port(), fmt::format("{} /api/scenes/{}/tours HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                                    "Content-Length: {}\r\n\r\n{}",
                                    method, hall, sidecar.size(), sidecar));
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 413 ")) << method;
    EXPECT_THAT(answer.substr(1), Not(HasSubstr("HTTP/1.1"))) << "one answer: " << method;
  }
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_EQ(http_get(server->port(), "/healthz").status, 200);
}

/// Two authors opened the scene before either of them saved.
TEST_F(SidecarUpload, ReplacesNothingThatItsAuthorHasNotSeen) {
  ASSERT_TRUE(tours_as(author)["document"]["etag"].is_null());
  const HttpReply first = put(author, {{"if-none-match", "*"}});
  EXPECT_EQ(first.status, 200) << first.body;
  const std::string tag = first.headers.at("etag");
  EXPECT_EQ(tours_as(author)["document"]["etag"], tag);

  const HttpReply second = put(author, {{"if-none-match", "*"}}, other_sidecar);
  EXPECT_EQ(second.status, 412);
  EXPECT_EQ(second.headers.at("etag"), tag) << "with which it can be replaced on purpose";
  EXPECT_EQ(tours_as(author)["document"]["tours"][0]["title"], "Hall");

  const HttpReply replaced = put(author, {{"if-match", tag}}, other_sidecar);
  EXPECT_EQ(replaced.status, 200) << replaced.body;
  EXPECT_NE(replaced.headers.at("etag"), tag);
  EXPECT_EQ(put(author, {{"if-match", tag}}).status, 412);
  EXPECT_EQ(tours_as(author)["document"]["tours"][0]["title"], "Other");
  EXPECT_EQ(put(author).status, 200) << "who asks nothing of it replaces whatever is there";
}

/// By another server of the same folder, or by hand.
TEST_F(SidecarUpload, ShowsWhatOthersWroteMeanwhile) {
  const std::string tag = put(author).headers.at("etag");
  folder->write(file, R"({"tours": [{"title": "Theirs", "stops": []}],
                                "start_pose": {"position": [4, 5, 6], "look_at": [4, 5, 9]}})");
  EXPECT_EQ(put(author, {{"if-match", tag}}).status, 412);
  const auto document = tours_as(author)["document"];
  EXPECT_EQ(document["tours"][0]["title"], "Theirs");
  EXPECT_FLOAT_EQ(start_z(), 6.0f);
  EXPECT_EQ(put(author, {{"if-match", document["etag"]}}).status, 200);
  std::filesystem::remove(file);
  EXPECT_EQ(put(author, {{"if-match", tag}}).status, 412) << "it was taken away";
  EXPECT_TRUE(tours_as(author)["document"]["etag"].is_null());
}

/// The answer keeps to itself where the server has its scenes: that concerns the operator alone.
TEST_F(SidecarUpload, SaysWhereNothingCanBeWrittenAndNamesNoFolder) {
  EXPECT_EQ(http_put(server->port(), "/api/scenes/garden/sidecar", "{}", bearer(author)).status,
            409)
      << "a generated scene has no file";
  std::filesystem::create_directories(file / "inside");
  const HttpReply taken = put(author);
  EXPECT_EQ(taken.status, 409);
  EXPECT_THAT(taken.body, AllOf(HasSubstr(hall + ".json"), HasSubstr("have the folder removed"),
                                Not(HasSubstr(folder->path().string()))));
}

TEST_F(SidecarUpload, BeyondItsSlotsIsAskedToComeAgain) {
  std::vector<RawSocket> slow;  // who sends everything but the end
  const auto begin = [&](const std::string& by) {
    slow.emplace_back(server->port());
    slow.back().send(head(by, sidecar.size()) + std::string(sidecar.substr(1)));
  };
  const std::string others[] = {make_link("author", "", "22"), make_link("author", "", "33")};
  // A slot is free a little after its answer.
  ASSERT_TRUE(eventually([&] {
    begin(author);
    return put(author).status == 503;
  }));
  const HttpReply refused = put(author);
  EXPECT_EQ(refused.headers.at("retry-after"), "1");
  EXPECT_EQ(refused.headers.at("connection"), "close");
  EXPECT_THAT(refused.body, HasSubstr("others are saving"));
  EXPECT_EQ(put(others[0]).status, 200) << "there are places that one link cannot have";
  EXPECT_GE(metric(*server, "catgs_uploads_refused_total"), 2.0);

  ASSERT_TRUE(eventually([&] {
    begin(others[0]);
    return put(others[1]).status == 503;
  })) << "all that one address may have are taken";
  EXPECT_EQ(http_get(server->port(), "/healthz").status, 200);
  slow.clear();
  EXPECT_TRUE(eventually([&] { return put(author).status == 200; })) << "they are free again";
}

/// What it sent has come with the end of its connection.
TEST_F(SidecarUpload, IsNotSavedWhenItsAuthorHasGone) {
  RawSocket gone(server->port());
  gone.send_and_close(head(author, sidecar.size()) + std::string(sidecar));
  EXPECT_EQ(put(author, {{"if-none-match", "*"}}, other_sidecar).status, 200);
  EXPECT_EQ(tours_as(author)["document"]["tours"][0]["title"], "Other");
}

TEST_F(SidecarUpload, UnderWayWhenTheServerStopsIsAnswered) {
  start();  // with all slots free
  std::vector<RawSocket> late;
  for (std::size_t i = 0; i < UploadSlots::small.of_a_link; ++i) {
    late.emplace_back(server->port());
    late.back().send(head(author, sidecar.size()) + std::string(sidecar.substr(0, 9)));
  }
  ASSERT_TRUE(eventually([&] { return put(author, {}, "{").status == 503; })) << "they are there";
  server->stop();
  bool saved = false;
  for (RawSocket& one : late) {
    one.send(sidecar.substr(9));
    std::string answer;
    ASSERT_TRUE(one.receive_until("\r\n\r\n", answer)) << answer;
    EXPECT_THAT(answer, AnyOf(StartsWith("HTTP/1.1 200 "), StartsWith("HTTP/1.1 503 ")));
    saved |= answer.find(" 200 ") != answer.npos;
  }
  server->join();
  EXPECT_EQ(std::filesystem::exists(file), saved);
  start();
}

}  // namespace
}  // namespace catgs::test
