// Integration: authors save tours. Real sockets on loopback, a whole server in this process.

#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/files/save_scene.h"
#include "render_core/synth/synth.h"
#include "server/access/access.h"
#include "server/net/http.h"
#include "server/net/upload_places.h"
#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr std::string_view sidecar =
    R"({"up": "-y", "start_pose": {"position": [1, 2, 3], "look_at": [1, 2, 9]},
        "tours": [{"title": "Hall", "stops": [{"position": [1, 2, 3], "look_at": [0, 0, 0]}]}]})";

class SidecarUpload : public testing::Test {
 protected:
  SidecarUpload()
      : scene(folder / "hall.ply"), key_file(folder.write("key", std::string(32, 'k'))) {
    save_scene(synthesize(SynthKind::city, 2000, 1).cloud, scene);
    server.emplace([&](ServerConfig& config) {
      config.scenes = {scene.string(), "synth:garden:2000"};
      config.token_key_file = key_file.string();
      config.allow_origins = {"https://tours.example"};
    });
  }

  /// `life`: links of another one are others.
  [[nodiscard]] std::string token(const std::string& role, const std::string& of = "",
                                  std::int64_t life = 1'000'000'000'000) const {
    return make_link_token({of, role, life}, read_key_file("", key_file));
  }
  static std::string head(const std::string& by, std::size_t body_bytes) {
    return fmt::format(
        "PUT /api/scenes/hall/sidecar HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {}\r\n"
        "Content-Length: {}\r\n\r\n",
        by, body_bytes);
  }
  HttpReply put(const std::string& by, std::map<std::string, std::string> headers = {},
                std::string_view body = sidecar, const std::string& id = "hall") {
    if (!by.empty()) headers["authorization"] = "Bearer " + by;
    return http_put(server->port(), "/api/scenes/" + id + "/sidecar", std::string(body), headers);
  }
  nlohmann::json tours_as(const std::string& by) {
    return nlohmann::json::parse(
        http_get(server->port(), "/api/scenes/hall/tours", {{"authorization", "Bearer " + by}})
            .body);
  }

  const TemporaryFolder folder;
  const std::filesystem::path scene;
  const std::filesystem::path key_file;
  std::optional<RunningServer> server;
};

TEST_F(SidecarUpload, IsInForceForTheNextVisitor) {
  WireClient before(server->port());
  const auto old_start =
      before.greet(64, 64, v1::CODEC_H264, token("viewer")).scene().start_pose().position();
  const HttpReply reply = put(token("author"));
  EXPECT_EQ(reply.status, 200) << reply.body;

  std::ifstream written(folder / "hall.json");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(written), {}), sidecar);
  EXPECT_EQ(tours_as(token("viewer"))["document"]["tours"][0]["title"], "Hall");
  WireClient visitor(server->port());
  const auto start =
      visitor.greet(64, 64, v1::CODEC_H264, token("viewer")).scene().start_pose().position();
  EXPECT_FLOAT_EQ(start.z(), 3.0f);
  EXPECT_NE(old_start.z(), start.z());
}

TEST_F(SidecarUpload, IsForAuthorsAlone) {
  for (const char* role : {"viewer", "solo", "spectator"}) {
    const HttpReply refused = put(token(role));
    EXPECT_EQ(refused.status, 403) << role;
    EXPECT_THAT(refused.body, HasSubstr("role author")) << role;
    EXPECT_EQ(tours_as(token(role))["may_save"], false) << role;
  }
  EXPECT_EQ(put("").status, 401);
  EXPECT_EQ(put("guess").status, 401);
  EXPECT_EQ(put(token("author", "garden")).status, 401) << "a link for another scene";
  EXPECT_EQ(tours_as(token("author"))["may_save"], true);
  EXPECT_FALSE(std::filesystem::exists(folder / "hall.json"));
}

TEST_F(SidecarUpload, ComesFromAPageOfThisServer) {
  const std::string author = token("author");
  EXPECT_EQ(put(author, {{"origin", "https://evil.example"}}).status, 403);
  EXPECT_EQ(put(author, {{"host", "evil.example"}, {"origin", "http://evil.example"}}).status, 403)
      << "a name that was made to resolve to this address";
  EXPECT_FALSE(std::filesystem::exists(folder / "hall.json"));
  EXPECT_EQ(put(author, {{"origin", "https://tours.example"}}).status, 200);
  const std::string own = "http://127.0.0.1:" + std::to_string(server->port());
  EXPECT_EQ(put(author, {{"origin", own}}).status, 200);
}

TEST_F(SidecarUpload, IsCheckedBeforeAnythingIsWritten) {
  const std::string author = token("author");
  const HttpReply wrong = put(author, {}, R"({"tours": [{"stops": [{"position": [0, 0]}]}]})");
  EXPECT_EQ(wrong.status, 400);
  EXPECT_THAT(wrong.body, HasSubstr("tours[0].stops[0].position"));
  EXPECT_EQ(put(author, {}, "").status, 411);
  EXPECT_FALSE(std::filesystem::exists(folder / "hall.json"));
  EXPECT_EQ(put(author, {}, sidecar, "absent").status, 404);
  EXPECT_EQ(http_put(server->port(), "/index.html", "x", {}).status, 405);
  EXPECT_EQ(http_get(server->port(), "/healthz").status, 200) << "and goes on serving";
}

/// The whole of it is sent before the answer is read, as browsers do.
TEST_F(SidecarUpload, IsAnsweredAndNotCutOffWhenTooLong) {
  EXPECT_EQ(put(token("author"), {}, std::string(1 << 20, ' ')).status, 400) << "it is read";
  EXPECT_EQ(put(token("author"), {}, std::string((1 << 20) + 1, ' ')).status, 413);
  const HttpReply refused = put(token("author"), {}, std::string(4 * max_upload_bytes, ' '));
  EXPECT_EQ(refused.status, 413);
  EXPECT_THAT(refused.body, HasSubstr(std::to_string(1 << 20)));
  EXPECT_EQ(refused.headers.at("connection"), "close");
  EXPECT_FALSE(std::filesystem::exists(folder / "hall.json"));
}

TEST_F(SidecarUpload, IsNotReadWithoutEnd) {
  const std::string piece(1 << 20, ' ');
  for (const std::string method : {"PUT", "GET", "HEAD"}) {
    RawSocket endless(server->port());
    endless.send(method +
                 " /api/scenes/hall/sidecar HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: " +
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
    RawSocket odd(server->port());
    odd.send(method + " /api/scenes/hall/tours HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: " +
             std::to_string(sidecar.size()) + "\r\n\r\n" + std::string(sidecar));
    const std::string answer = odd.receive(std::chrono::milliseconds(300));
    EXPECT_THAT(answer, testing::HasSubstr(" 413 ")) << method;
    EXPECT_THAT(answer.substr(1), testing::Not(HasSubstr("HTTP/1.1"))) << "one answer: " << method;
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "hall.json"));
  EXPECT_EQ(http_get(server->port(), "/healthz").status, 200);
}

/// Two authors opened the scene before either of them saved.
TEST_F(SidecarUpload, ReplacesNothingThatItsAuthorHasNotSeen) {
  const std::string author = token("author");
  ASSERT_TRUE(tours_as(author)["document"]["etag"].is_null());
  const HttpReply first = put(author, {{"if-none-match", "*"}});
  EXPECT_EQ(first.status, 200) << first.body;
  const std::string tag = first.headers.at("etag");
  EXPECT_EQ(tours_as(author)["document"]["etag"], tag);

  const std::string other(R"({"tours": [{"title": "Other", "stops": []}]})");
  const HttpReply second = put(author, {{"if-none-match", "*"}}, other);
  EXPECT_EQ(second.status, 412);
  EXPECT_THAT(second.body, HasSubstr("somebody else saved this scene"));
  EXPECT_EQ(second.headers.at("etag"), tag) << "with which it can be replaced on purpose";
  EXPECT_EQ(tours_as(author)["document"]["tours"][0]["title"], "Hall");

  const HttpReply replaced = put(author, {{"if-match", tag}}, other);
  EXPECT_EQ(replaced.status, 200) << replaced.body;
  EXPECT_NE(replaced.headers.at("etag"), tag);
  EXPECT_EQ(put(author, {{"if-match", tag}}).status, 412);
  EXPECT_EQ(tours_as(author)["document"]["tours"][0]["title"], "Other");
  EXPECT_EQ(put(author).status, 200) << "who asks nothing of it replaces whatever is there";
}

/// By another server of the same folder, or by hand.
TEST_F(SidecarUpload, ShowsWhatOthersWroteMeanwhile) {
  const std::string author = token("author");
  const std::string tag = put(author).headers.at("etag");
  folder.write("hall.json", R"({"tours": [{"title": "Theirs", "stops": []}],
                                "start_pose": {"position": [4, 5, 6], "look_at": [4, 5, 9]}})");
  EXPECT_EQ(put(author, {{"if-match", tag}}).status, 412);
  const auto document = tours_as(author)["document"];
  EXPECT_EQ(document["tours"][0]["title"], "Theirs");
  WireClient visitor(server->port());
  EXPECT_FLOAT_EQ(visitor.greet(64, 64, v1::CODEC_H264, author).scene().start_pose().position().z(),
                  6.0f);
  EXPECT_EQ(put(author, {{"if-match", document["etag"]}}).status, 200);
  std::filesystem::remove(folder / "hall.json");
  EXPECT_EQ(put(author, {{"if-match", tag}}).status, 412) << "it was taken away";
  EXPECT_TRUE(tours_as(author)["document"]["etag"].is_null());
}

TEST_F(SidecarUpload, SaysWhereNothingCanBeWritten) {
  const HttpReply made_up = put(token("author"), {}, sidecar, "garden");
  EXPECT_EQ(made_up.status, 409);
  EXPECT_THAT(made_up.body, HasSubstr("no file"));
  // Where the sidecar should be is a folder: as good as a folder that is read-only.
  std::filesystem::create_directories(folder / "hall.json" / "inside");
  const HttpReply taken = put(token("author"));
  EXPECT_EQ(taken.status, 409);
  EXPECT_THAT(taken.body, HasSubstr("download the file"));
}

/// Where the server keeps its scenes is the operator's matter.
TEST_F(SidecarUpload, TellsNobodyTheServersFolders) {
  std::filesystem::create_directory(folder / "hall.json");  // no file can replace it
  const HttpReply refused = put(token("author"));
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("hall.json"));
  EXPECT_THAT(refused.body, Not(HasSubstr(scene.parent_path().string())));
}

TEST_F(SidecarUpload, BeyondItsPlacesIsToldToComeAgain) {
  std::vector<RawSocket> slow;  // who sends everything but the end
  const auto begin = [&](const std::string& by) {
    slow.emplace_back(server->port());
    slow.back().send(head(by, sidecar.size()) + std::string(sidecar.substr(1)));
  };
  const std::string greedy = token("author");
  const std::string others[] = {token("author", "", 2'000'000'000'000),
                                token("author", "", 3'000'000'000'000)};
  for (std::size_t i = 0; i < UploadPlaces::small.of_a_link; ++i) begin(greedy);
  ASSERT_TRUE(eventually([&] { return put(greedy).status == 503; }));
  const HttpReply refused = put(greedy);
  EXPECT_EQ(refused.headers.at("retry-after"), "1");
  EXPECT_EQ(refused.headers.at("connection"), "close");
  EXPECT_THAT(refused.body, HasSubstr("others are saving"));
  EXPECT_EQ(put(others[0]).status, 200) << "there are places that one link cannot have";
  EXPECT_GE(metric(*server, "catgs_uploads_refused_total"), 2.0);

  // The place of the last one is free a little after its answer.
  ASSERT_TRUE(eventually([&] {
    begin(others[0]);
    return put(others[1]).status == 503;
  })) << "all that one address may have are taken";
  EXPECT_EQ(http_get(server->port(), "/healthz").status, 200);
  slow.clear();
  EXPECT_TRUE(eventually([&] { return put(greedy).status == 200; })) << "they are free again";
}

/// What it sent has come with the end of its connection.
TEST_F(SidecarUpload, IsNotSavedWhenItsAuthorHasGone) {
  RawSocket gone(server->port());
  gone.send_and_close(head(token("author"), sidecar.size()) + std::string(sidecar));
  const std::string other(R"({"tours": [{"title": "Other", "stops": []}]})");
  EXPECT_EQ(put(token("author"), {{"if-none-match", "*"}}, other).status, 200);
  EXPECT_EQ(tours_as(token("author"))["document"]["tours"][0]["title"], "Other");
}

TEST_F(SidecarUpload, UnderWayWhenTheServerStopsIsAnswered) {
  const std::string author = token("author");
  std::vector<RawSocket> late;
  for (std::size_t i = 0; i < UploadPlaces::small.of_a_link; ++i) {
    late.emplace_back(server->port());
    late.back().send(head(author, sidecar.size()) + std::string(sidecar.substr(0, 9)));
  }
  ASSERT_TRUE(eventually([&] { return put(author).status == 503; })) << "they are there";
  const bool saved_before = std::filesystem::exists(folder / "hall.json");
  server->stop();
  bool saved = saved_before;
  for (RawSocket& one : late) {
    one.send(sidecar.substr(9));
    std::string answer;
    ASSERT_TRUE(one.receive_until("\r\n\r\n", answer)) << answer;
    EXPECT_THAT(answer, testing::AnyOf(HasSubstr(" 200 "), HasSubstr(" 503 ")));
    saved |= answer.find(" 200 ") != answer.npos;
  }
  server->join();
  EXPECT_EQ(std::filesystem::exists(folder / "hall.json"), saved);
}

}  // namespace
}  // namespace catgs::test
