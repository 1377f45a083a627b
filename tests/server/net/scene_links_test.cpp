// Integration: links to scenes of one name, before and after files were moved.

#include "render_core/scene/files/save_scene.h"
#include "server/scenes/scene_ids.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/server_client.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

constexpr const char* own_tours = R"({"tours": [{"title": "Mine", "stops": []}]})";

/// Two folders, each of which may hold hall.ply: of 100 Gaussians in the north, 200 in the south.
class SceneLinks : public FolderTest {
 protected:
  SceneLinks() {
    for (const char* wing : {"north", "south"}) std::filesystem::create_directories(folder_ / wing);
    save_scene(random_cloud(100, 0, 1), folder_ / "north/hall.ply");
    save_scene(random_cloud(200, 0, 2), folder_ / "south/hall.ply");
  }
  void start() {
    server_.reset();
    server_ = std::make_unique<RunningServer>([&](ServerConfig& config) {
      config.scene_folders = {folder_ / "north", folder_ / "south"};
      config.token_key_file = link_key_file();
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
  v1::Welcome visit(const std::string& scene, const std::string& token) const {
    return WireClient(server_->port()).greet(hello_by(token, scene));
  }
  v1::Error refused(const v1::ClientMessage& hello) const {
    return refusal(server_->port(), hello);
  }
  HttpReply put(const std::string& scene, const std::string& token) const {
    return http_put(server_->port(), "/api/scenes/" + scene + "/sidecar", own_tours, bearer(token));
  }
  HttpReply tours(const std::string& scene, const std::string& token) const {
    return http_get(server_->port(), "/api/scenes/" + scene + "/tours", bearer(token));
  }
  bool saved(const std::string& wing) const {
    return std::filesystem::exists(folder_ / wing / "hall.json");
  }

  std::unique_ptr<RunningServer> server_;
};

TEST_F(SceneLinks, AnOldLinkNeitherOpensNorWritesTheSceneThatIsLeft) {
  start();
  const std::string north = id_in("north"), south = id_in("south");
  const std::string viewer = make_link("viewer", north), author = make_link("author", north);
  EXPECT_EQ(visit(north, viewer).scene().gaussians(), 100u);
  EXPECT_EQ(visit(south, make_link("viewer", south)).scene().gaussians(), 200u);
  EXPECT_EQ(put(north, author).status, 200);
  EXPECT_TRUE(saved("north"));
  EXPECT_FALSE(saved("south"));

  start_without("north");
  EXPECT_EQ(visit(south, make_link("viewer", south)).scene().gaussians(), 200u) << "its id stays";
  for (const std::string& token : {viewer, author}) {
    const v1::Error error = refused(hello_by(token, north));
    EXPECT_EQ(error.code(), v1::Error::UNKNOWN_SCENE);
    EXPECT_THAT(error.message(), HasSubstr("moved or removed; ask for a new link"));
    for (const std::string& scene : {std::string("hall"), south})
      EXPECT_EQ(refused(hello_by(token, scene)).code(), v1::Error::UNAUTHORIZED);
  }
  EXPECT_EQ(put(north, author).status, 404);
  for (const std::string& scene : {std::string("hall"), south}) {
    EXPECT_EQ(put(scene, author).status, 401);
    EXPECT_EQ(tours(scene, author).status, 401);
  }
  EXPECT_FALSE(saved("south"));
}

/// Links that say "hall" were all that there was before ids had digests.
TEST_F(SceneLinks, ALinkOfBeforeKeepsWorkingWhereNothingCollided) {
  start_without("south");
  const std::string viewer = make_link("viewer", "hall"), author = make_link("author", "hall");
  EXPECT_EQ(visit("hall", viewer).scene().scene_id(), id_in("north"));
  EXPECT_EQ(tours("hall", viewer).status, 200);
  EXPECT_EQ(put("hall", viewer).status, 403);
  EXPECT_EQ(put("hall", author).status, 200);
  EXPECT_EQ(put(id_in("north"), author).status, 200) << "as the page asks";
  EXPECT_TRUE(saved("north"));
  EXPECT_THAT(http_get(server_->port(), "/api/scenes", bearer(viewer)).body,
              HasSubstr(id_in("north")));
}

TEST_F(SceneLinks, ALinkOfBeforeOpensNoneOfTwo) {
  start();
  const std::string viewer = make_link("viewer", "hall"), author = make_link("author", "hall");
  const v1::Error error = refused(hello_by(viewer, "hall"));
  EXPECT_EQ(error.code(), v1::Error::UNKNOWN_SCENE);
  EXPECT_THAT(error.message(), HasSubstr("several of this name"));
  EXPECT_EQ(put("hall", author).status, 404);
  for (const char* wing : {"north", "south"}) {
    EXPECT_EQ(refused(hello_by(viewer, id_in(wing))).code(), v1::Error::UNAUTHORIZED);
    EXPECT_EQ(put(id_in(wing), author).status, 401);
    EXPECT_FALSE(saved(wing));
  }
}

/// The page of an author who may see everything stays open while the server starts anew.
TEST_F(SceneLinks, AReturningVisitorGetsNoOtherSceneOfTheName) {
  std::filesystem::rename(folder_ / "south/hall.ply", folder_ / "later");
  start();
  const std::string author = make_link("author", "");
  const v1::Welcome welcome = visit("hall", author);
  EXPECT_EQ(welcome.scene().gaussians(), 100u);
  std::filesystem::rename(folder_ / "later", folder_ / "south/hall.ply");
  start_without("north");
  v1::ClientMessage back = hello_by(author, "hall");
  back.mutable_hello()->mutable_resume()->set_token(welcome.resume_token());
  EXPECT_EQ(refused(back).code(), v1::Error::UNKNOWN_SCENE);
  EXPECT_EQ(put(welcome.scene().scene_id(), author).status, 404);
  EXPECT_FALSE(saved("south"));
}

}  // namespace
}  // namespace catgs::test
