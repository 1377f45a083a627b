// Integration: authors order pictures and films. Real sockets on loopback, a whole server in this
// process.

#include <nlohmann/json.hpp>

#include "render_core/scene/files/save_scene.h"
#include "render_core/synth/synth.h"
#include "server/access/access.h"
#include "server/base/scene_id.h"
#include "server/net/upload_slots.h"
#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

constexpr auto picture =
    R"({"kind": "picture", "size": [64, 48], "views": [[0, 0, -5, 0, 0, 0, 1, 60]]})";
/// Ten minutes of it, which are never drawn to their end.
constexpr auto film =
    R"({"kind": "film", "size": [1920, 1080], "views": [[0, 0, -5, 0, 0, 0, 1, 60], 17999]})";

/// One server for all cases: each is another author's.
class Films : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = std::make_unique<TemporaryFolder>();
    std::filesystem::create_directory(*folder / "scenes");
    save_scene(synthesize(SynthKind::city, 2000, 1).cloud, *folder / "scenes/hall.ply");
    server = std::make_unique<RunningServer>(configure);
  }
  static void TearDownTestSuite() {
    server.reset();
    folder.reset();
  }
  static void configure(ServerConfig& config) {
    config.scene_folders = {(*folder / "scenes").string()};
    config.token_key_file = link_key_file();
  }
  static HttpReply order(const std::string& json, const std::string& by,
                         const std::string& scene = "city", int port = server->port()) {
    return http_put(port, "/api/scenes/" + scene + "/films", json, bearer(by));
  }
  static std::string job_of(const HttpReply& reply) {
    return nlohmann::json::parse(reply.body).at("id");
  }
  static nlohmann::json report(const std::string& job, int port = server->port()) {
    return nlohmann::json::parse(http_get(port, "/api/films/" + job).body);
  }
  static int cancel(const std::string& job, int port = server->port()) {
    return http_put(port, "/api/films/" + job + "/cancel", "x").status;
  }
  static bool ends(const std::string& job) {
    return eventually([&] {
      const std::string state = report(job).at("state");
      return state != "waiting" && state != "drawing";
    });
  }

  static inline std::unique_ptr<TemporaryFolder> folder;
  static inline std::unique_ptr<RunningServer> server;
  const std::string author = make_link("author", "", new_link_id());
};

TEST_F(Films, AreOrderedByAuthorsAlone) {
  EXPECT_EQ(http_put(server->port(), "/api/scenes/city/films", picture).status, 401);
  EXPECT_EQ(order(picture, "guess").status, 401);
  EXPECT_EQ(order(picture, make_link("author", "garden")).status, 401);
  EXPECT_EQ(order(picture, make_link("viewer")).status, 403);
  EXPECT_EQ(order(picture, author, "absent").status, 404);
  EXPECT_EQ(order(R"({"kind": "statue"})", author).status, 400);

  const HttpReply taken = order(picture, author);
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
  const std::string job = job_of(order(film, author));
  EXPECT_EQ(order(picture, author).status, 409) << "one at a time";
  EXPECT_EQ(http_get(server->port(), "/api/films/" + job + "/file").status, 404) << "not ready";
  EXPECT_EQ(cancel(job), 200);
  EXPECT_EQ(report(job).at("state"), "cancelled");
  EXPECT_EQ(order(picture, author).status, 202);
}

TEST_F(Films, DeleteCancelsTheJob) {
  const std::string job = "/api/films/" + job_of(order(film, author));
  const auto send_delete = [&](const std::string& path, const std::string& headers = "") {
    return raw_answer(server->port(),
                      "DELETE " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\n" + headers + "\r\n");
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
  for (std::size_t i = 0; i < 2 * UploadSlots::small.all; ++i) {
    strangers.emplace_back(server->port());
    strangers.back().send(
        "PUT /api/films/guess/cancel HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\n");
  }
  EXPECT_EQ(cancel("guess"), 404);
  EXPECT_EQ(order(picture, author).status, 202) << "their bodies never come";
}

TEST_F(Films, ShutNoVisitorOut) {
  const TemporaryFolder scenes;
  for (const char* name : {"barn.ply", "hall.ply"})
    save_scene(synthesize(SynthKind::city, 3000, 1).cloud, scenes / name);
  const RunningServer small([&](ServerConfig& config) {
    config.scenes.clear();
    config.scene_folders = {scenes.path().string()};
    config.token_key_file = link_key_file();
    config.scene_memory_mb = 1;  // for one of them
    config.scene_residency_s = 0;
  });
  const std::string job = job_of(order(film, author, "barn", small.port()));
  const auto share = [&] { return report(job, small.port()).at("share").get<double>(); };
  ASSERT_TRUE(eventually([&] { return share() > 0.0; }));
  WireClient visitor(small.port());
  EXPECT_EQ(name_in(visitor.greet(hello_by(author, "hall")).scene().scene_id()), "hall");
  EXPECT_EQ(report(job, small.port()).at("state"), "drawing") << "it waits for its scene";
  visitor.close(1001);
  const double before = share();
  EXPECT_TRUE(eventually([&] { return share() > before; })) << "and continues";
  EXPECT_EQ(cancel(job, small.port()), 200);
}

TEST_F(Films, NeedASceneInMemory) {
  const std::string job = job_of(order(picture, author, "hall"));
  ASSERT_TRUE(ends(job));
  EXPECT_EQ(report(job).at("state"), "failed");
  EXPECT_THAT(report(job).at("error"), HasSubstr("not in memory"));
}

}  // namespace
}  // namespace catgs::test
