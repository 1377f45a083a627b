// Integration: links to scenes of one name, before and after files were moved.

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/scene/files/save_scene.h"
#include "server/access/access.h"
#include "server/base/scene_id.h"
#include "server/scenes/scene_ids.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/server_client.h"

namespace catgs::test {
namespace {

using testing::HasSubstr;

constexpr const char* own_tours = R"({"tours": [{"title": "Mine", "stops": []}]})";

/// Two folders, each of which may hold hall.ply: of 100 Gaussians in the north, 200 in the south.
class SceneLinks : public FolderTest {
 protected:
  SceneLinks() : key_file_(write("key", std::string(32, 'k'))) {
    for (const char* wing : {"north", "south"}) std::filesystem::create_directories(folder_ / wing);
    save_scene(random_cloud(100, 0, 1), folder_ / "north/hall.ply");
    save_scene(random_cloud(200, 0, 2), folder_ / "south/hall.ply");
  }
  void start() {
    server_.reset();
    server_ = std::make_unique<RunningServer>([&](ServerConfig& config) {
      config.scene_folders = {folder_ / "north", folder_ / "south"};
      config.token_key_file = key_file_.string();
    });
  }
  void start_without(const std::string& wing) {
    server_.reset();
    std::filesystem::rename(folder_ / wing / "hall.ply", folder_ / "away");
    start();
  }
  std::string id_in(const std::string& wing) const {
    return SceneIds({}, {folder_ / "north", folder_ / "south"})
        .id_of(folder_ / wing / "hall.ply", "hall");
  }
  /// A link as `catgs-server token` makes it.
  std::string link(const std::string& to, const std::string& role) const {
    return make_link_token({to, role, 1'000'000'000'000}, read_key_file("", key_file_));
  }
  static v1::ClientMessage hello(const std::string& scene, const std::string& token,
                                 const std::string& resume_token = {}) {
    auto message = resuming_hello(resume_token);
    message.mutable_hello()->set_scene_id(scene);
    message.mutable_hello()->set_token(token);
    return message;
  }
  v1::Welcome visit(const std::string& scene, const std::string& token) const {
    return WireClient(server_->port()).greet(hello(scene, token));
  }
  v1::Error refusal(const v1::ClientMessage& hello) const {
    WireClient client(server_->port());
    client.send(hello);
    for (;;) {
      const Received said = client.receive();
      if (said.message && said.message->has_error()) return said.message->error();
      if (said.closed || (said.message && said.message->has_welcome())) return {};
    }
  }
  HttpReply put(const std::string& scene, const std::string& token) const {
    return http_put(server_->port(), "/api/scenes/" + scene + "/sidecar", own_tours,
                    {{"authorization", "Bearer " + token}});
  }
  HttpReply tours(const std::string& scene, const std::string& token) const {
    return http_get(server_->port(), "/api/scenes/" + scene + "/tours",
                    {{"authorization", "Bearer " + token}});
  }
  bool saved(const std::string& wing) const {
    return std::filesystem::exists(folder_ / wing / "hall.json");
  }

  const std::filesystem::path key_file_;
  std::unique_ptr<RunningServer> server_;
};

TEST_F(SceneLinks, AnOldLinkNeitherOpensNorWritesTheSceneThatIsLeft) {
  start();
  const std::string north = id_in("north"), south = id_in("south");
  const std::string viewer = link(north, "viewer"), author = link(north, "author");
  EXPECT_EQ(visit(north, viewer).scene().gaussians(), 100u);
  EXPECT_EQ(visit(south, link(south, "viewer")).scene().gaussians(), 200u);
  EXPECT_EQ(put(north, author).status, 200);
  EXPECT_TRUE(saved("north"));
  EXPECT_FALSE(saved("south"));

  start_without("north");
  EXPECT_EQ(visit(south, link(south, "viewer")).scene().gaussians(), 200u) << "its id stays";
  for (const std::string& token : {viewer, author}) {
    v1::Error error = refusal(hello(north, token));
    EXPECT_EQ(error.code(), v1::Error::UNKNOWN_SCENE);
    EXPECT_THAT(error.message(), HasSubstr("moved or removed; ask for a new link"));
    for (const std::string& scene : {std::string("hall"), south}) {
      error = refusal(hello(scene, token));
      EXPECT_EQ(error.code(), v1::Error::UNAUTHORIZED);
      EXPECT_THAT(error.message(), HasSubstr("made for another scene called \"hall\""));
    }
  }
  const HttpReply gone = put(north, author);
  EXPECT_EQ(gone.status, 404);
  EXPECT_THAT(gone.body, HasSubstr("ask for a new link"));
  for (const std::string& scene : {std::string("hall"), south}) {
    const HttpReply other = put(scene, author);
    EXPECT_EQ(other.status, 401);
    EXPECT_THAT(other.body, HasSubstr("made for another scene called \"hall\""));
    EXPECT_EQ(tours(scene, author).status, 401);
  }
  EXPECT_FALSE(saved("south"));
}

/// Links that say "hall" were all that there was before ids had digests.
TEST_F(SceneLinks, ALinkOfBeforeKeepsWorkingWhereNothingCollided) {
  start_without("south");
  const std::string viewer = link("hall", "viewer"), author = link("hall", "author");
  EXPECT_EQ(visit("hall", viewer).scene().scene_id(), id_in("north"));
  EXPECT_EQ(tours("hall", viewer).status, 200);
  EXPECT_EQ(put("hall", viewer).status, 403);
  EXPECT_EQ(put("hall", author).status, 200);
  EXPECT_EQ(put(id_in("north"), author).status, 200) << "as the page asks";
  EXPECT_TRUE(saved("north"));
  EXPECT_THAT(
      http_get(server_->port(), "/api/scenes", {{"authorization", "Bearer " + viewer}}).body,
      HasSubstr(id_in("north")));
}

TEST_F(SceneLinks, ALinkOfBeforeOpensNoneOfTwo) {
  start();
  const std::string viewer = link("hall", "viewer"), author = link("hall", "author");
  const v1::Error error = refusal(hello("hall", viewer));
  EXPECT_EQ(error.code(), v1::Error::UNKNOWN_SCENE);
  EXPECT_THAT(error.message(), HasSubstr("several of this name: ask for a new link"));
  EXPECT_EQ(put("hall", author).status, 404);
  for (const char* wing : {"north", "south"}) {
    EXPECT_EQ(refusal(hello(id_in(wing), viewer)).code(), v1::Error::UNAUTHORIZED);
    EXPECT_EQ(put(id_in(wing), author).status, 401);
    EXPECT_FALSE(saved(wing));
  }
}

/// The page of an author who may see everything stays open while the server starts anew.
TEST_F(SceneLinks, AReturningVisitorGetsNoOtherSceneOfTheName) {
  std::filesystem::rename(folder_ / "south/hall.ply", folder_ / "later");
  start();
  const std::string author = link("", "author");
  const v1::Welcome welcome = visit("hall", author);
  EXPECT_EQ(welcome.scene().gaussians(), 100u);
  std::filesystem::rename(folder_ / "later", folder_ / "south/hall.ply");
  start_without("north");
  const v1::Error error = refusal(hello("hall", author, welcome.resume_token()));
  EXPECT_EQ(error.code(), v1::Error::UNKNOWN_SCENE);
  EXPECT_THAT(error.message(), HasSubstr("moved or removed"));
  EXPECT_EQ(put(welcome.scene().scene_id(), author).status, 404);
  EXPECT_FALSE(saved("south"));
}

}  // namespace
}  // namespace catgs::test
