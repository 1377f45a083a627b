// Integration: authors order pictures and films. Real sockets on loopback, a whole server in this
// process.

#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/files/save_scene.h"
#include "render_core/synth/synth.h"
#include "server/access/access.h"
#include "server/net/upload_places.h"
#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::StartsWith;

constexpr auto picture =
    R"({"kind": "picture", "size": [64, 48], "views": [[0, 0, -5, 0, 0, 0, 1, 60]]})";
/// Ten minutes of it, which are never drawn to their end.
constexpr auto film =
    R"({"kind": "film", "size": [1920, 1080], "views": [[0, 0, -5, 0, 0, 0, 1, 60], 17999]})";

class Films : public testing::Test {
 protected:
  Films() : key_file(folder.write("key", std::string(32, 'k'))) {
    std::filesystem::create_directory(folder / "scenes");
    save_scene(synthesize(SynthKind::city, 2000, 1).cloud, folder / "scenes/hall.ply");
    server.emplace([&](ServerConfig& config) {
      config.scenes = {"synth:city:2000"};
      config.scene_folders = {(folder / "scenes").string()};
      config.token_key_file = key_file.string();
    });
  }
  [[nodiscard]] std::string token(const std::string& role, const std::string& of = "") const {
    return make_link_token({of, role, 1'000'000'000'000}, read_key_file("", key_file));
  }
  HttpReply order(const std::string& json, const std::string& by,
                  const std::string& scene = "city") {
    std::map<std::string, std::string> headers;
    if (!by.empty()) headers["authorization"] = "Bearer " + by;
    return http_put(server->port(), "/api/scenes/" + scene + "/films", json, headers);
  }
  static std::string job_of(const HttpReply& reply) {
    return nlohmann::json::parse(reply.body).at("id");
  }
  nlohmann::json report(const std::string& job) {
    return nlohmann::json::parse(http_get(server->port(), "/api/films/" + job).body);
  }
  int cancel(const std::string& job) {
    return http_put(server->port(), "/api/films/" + job + "/cancel", "x").status;
  }
  bool ends(const std::string& job) {
    return eventually([&] {
      const std::string state = report(job).at("state");
      return state != "waiting" && state != "drawing";
    });
  }

  const TemporaryFolder folder;
  const std::filesystem::path key_file;
  std::optional<RunningServer> server;
};

TEST_F(Films, AreOrderedByAuthorsAlone) {
  EXPECT_EQ(order(picture, "").status, 401);
  EXPECT_EQ(order(picture, "guess").status, 401);
  EXPECT_EQ(order(picture, token("author", "garden")).status, 401);
  EXPECT_EQ(order(picture, token("viewer")).status, 403);
  EXPECT_EQ(order(picture, token("author"), "absent").status, 404);
  EXPECT_THAT(order(R"({"kind": "statue"})", token("author")).body, HasSubstr("400: "));

  const HttpReply taken = order(picture, token("author"));
  ASSERT_EQ(taken.status, 202) << taken.body;
  const std::string job = job_of(taken);
  ASSERT_TRUE(ends(job));
  EXPECT_EQ(report(job).at("state"), "done") << report(job);
  const HttpReply result = http_get(server->port(), "/api/films/" + job + "/file");
  EXPECT_EQ(result.headers.at("content-type"), "image/png");
  EXPECT_EQ(result.body.size(), report(job).at("bytes"));
  EXPECT_EQ(cancel(job), 404) << "it has ended";
}

TEST_F(Films, AreCancelledByWhoKnowsTheirJob) {
  const std::string job = job_of(order(film, token("author")));
  EXPECT_EQ(order(picture, token("author")).status, 409) << "one at a time";
  const HttpReply early = http_get(server->port(), "/api/films/" + job + "/file");
  EXPECT_EQ(early.status, 404);
  EXPECT_THAT(early.body, HasSubstr("not ready yet: /api/films/" + job));
  EXPECT_EQ(cancel(job), 200);
  EXPECT_EQ(report(job).at("state"), "cancelled");
  EXPECT_EQ(order(picture, token("author")).status, 202);
}

TEST_F(Films, DeleteCancelsTheJob) {
  const std::string job = "/api/films/" + job_of(order(film, token("author")));
  const auto send_delete = [&](const std::string& path, const std::string& headers = "") {
    RawSocket socket(server->port());
    socket.send("DELETE " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\n" + headers + "\r\n");
    return socket.receive(20s);
  };
  const auto state = [&] {
    return nlohmann::json::parse(http_get(server->port(), job).body).at("state");
  };
  EXPECT_THAT(send_delete(job, "Origin: https://evil.example\r\n"), StartsWith("HTTP/1.1 403 "));
  EXPECT_THAT(send_delete(job, "Content-Length: 1\r\n"), StartsWith("HTTP/1.1 413 "));
  EXPECT_NE(state(), "cancelled");
  EXPECT_THAT(send_delete(job, "Content-Length: 0\r\n"), StartsWith("HTTP/1.1 200 "));
  EXPECT_EQ(state(), "cancelled");
  EXPECT_THAT(send_delete(job), StartsWith("HTTP/1.1 404 ")) << "it has ended";
  EXPECT_THAT(send_delete(job + "/file"), StartsWith("HTTP/1.1 405 "));
}

TEST_F(Films, StrangersFindNoJobAndTakeNoSlot) {
  for (const char* path : {"/api/films/guess", "/api/films/guess/file"})
    EXPECT_EQ(http_get(server->port(), path).status, 404) << path;
  std::vector<RawSocket> strangers;
  for (std::size_t i = 0; i < 2 * UploadPlaces::small.all; ++i) {
    strangers.emplace_back(server->port());
    strangers.back().send(
        "PUT /api/films/guess/cancel HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\n");
  }
  EXPECT_EQ(cancel("guess"), 404);
  EXPECT_EQ(order(picture, token("author")).status, 202) << "their bodies never come";
}

TEST_F(Films, ShutNoVisitorOut) {
  server.reset();
  for (const char* name : {"barn.ply", "hall.ply"})
    save_scene(synthesize(SynthKind::city, 3000, 1).cloud, folder / "scenes" / name);
  server.emplace([&](ServerConfig& config) {
    config.scenes.clear();
    config.scene_folders = {(folder / "scenes").string()};
    config.token_key_file = key_file.string();
    config.scene_memory_mb = 1;  // for one of them
    config.scene_residency_s = 0;
  });
  const std::string author = token("author");
  const std::string job = job_of(order(film, author, "barn"));
  ASSERT_TRUE(eventually([&] { return report(job).at("share") > 0.0; }));
  WireClient visitor(server->port());
  v1::ClientMessage hello = hello_message(160, 96, v1::CODEC_H264);
  hello.mutable_hello()->set_scene_id("hall");
  hello.mutable_hello()->set_token(author);
  EXPECT_THAT(visitor.greet(hello).scene().scene_id(), HasSubstr("hall"));
  EXPECT_EQ(report(job).at("state"), "drawing") << "it waits for its scene";
  visitor.close(1001);
  const double share = report(job).at("share");
  EXPECT_TRUE(eventually([&] { return report(job).at("share") > share; })) << "and goes on";
  EXPECT_EQ(cancel(job), 200);
}

TEST_F(Films, NeedASceneInMemory) {
  const std::string job = job_of(order(picture, token("author"), "hall"));
  ASSERT_TRUE(ends(job));
  EXPECT_EQ(report(job).at("state"), "failed");
  EXPECT_THAT(report(job).at("error"), HasSubstr("not in memory"));
}

}  // namespace
}  // namespace catgs::test
