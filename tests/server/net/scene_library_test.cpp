#include <cctype>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/frame/renderer.h"
#include "render_core/scene/files/save_scene.h"
#include "server/base/scene_id.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/server_client.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

/// A server with the demo city in memory and scenes in a folder, one of which fits beside it.
class SceneLibraryTest : public FolderTest {
 protected:
  SceneLibraryTest() {
    // 236 bytes each as decoded: 1.2 MB.
    save_scene(random_cloud(5000, 3, 1), folder_ / "attic.ply");
    save_scene(random_cloud(5000, 3, 2), folder_ / "barn.ply");
  }
  void start(int residency_s = 1) {
    server_ = std::make_unique<RunningServer>([&](ServerConfig& config) {
      config.scene_folders = {folder_.path()};
      config.scene_memory_mb = 2;
      config.scene_residency_s = residency_s;
    });
  }
  static v1::ClientMessage hello(const std::string& scene) { return hello_by("", scene); }
  std::unique_ptr<WireClient> connect() { return std::make_unique<WireClient>(server_->port()); }
  v1::Error refused(const std::string& scene) { return refusal(server_->port(), hello(scene)); }
  nlohmann::json listing() {
    return nlohmann::json::parse(http_get(server_->port(), "/api/scenes").body).at("scenes");
  }
  bool loaded(const std::string& name) {
    for (const auto& scene : listing())
      if (scene.at("title") == name) return scene.at("loaded");
    return false;
  }
  double count(const std::string& name) { return metric(*server_, name); }

  std::unique_ptr<RunningServer> server_;
};

TEST_F(SceneLibraryTest, LoadsAnExhibitWhenSomebodyAsksForIt) {
  start();
  const auto scenes = listing();
  ASSERT_EQ(scenes.size(), 3u) << scenes;
  EXPECT_EQ(scenes[0], (nlohmann::json{{"id", "city"},
                                       {"title", "city"},
                                       {"credits", ""},
                                       {"licence", ""},
                                       {"gaussians", 2000},
                                       {"loaded", true}}));
  EXPECT_EQ(scenes[1].at("gaussians"), 5000) << "from the header alone";
  EXPECT_FALSE(loaded("attic"));
  const HttpReply walkable_area = http_get(server_->port(), "/api/scenes/attic/walk");
  EXPECT_EQ(walkable_area.status, 404) << "nobody seeks it before the scene is in memory";
  EXPECT_EQ(walkable_area.headers.count("retry-after"), 1u);
  const auto client = connect();
  client->send(hello("attic"));
  EXPECT_TRUE(client->receive_message(v1::ServerMessage::kQueue).queue().for_scene());
  const auto welcome = client->receive_message(v1::ServerMessage::kWelcome).welcome();
  EXPECT_EQ(name_in(welcome.scene().scene_id()), "attic");
  EXPECT_EQ(welcome.scene().gaussians(), 5000u);
  EXPECT_EQ(welcome.scene_ids_size(), 3);
  client->send_pose(1);
  EXPECT_TRUE(client->receive_frame().header.idr());
  EXPECT_TRUE(loaded("attic"));
  EXPECT_FALSE(loaded("barn"));
  EXPECT_EQ(count("catgs_scenes_loaded_total"), 1);
  EXPECT_EQ(count("catgs_scenes_in_memory"), 2);
}

TEST_F(SceneLibraryTest, MakesRoomOnlyWhenNobodyLooksAnyMore) {
  start(0);  // its use alone keeps it
  const auto first = connect();
  first->greet(hello("attic"));
  const v1::Error error = refused("barn");
  EXPECT_EQ(error.code(), v1::Error::SERVER_FULL);
  EXPECT_THAT(error.message(), HasSubstr("no memory for \"barn\""));
  EXPECT_TRUE(loaded("attic"));
  first->close(1001);
  const auto second = connect();
  ASSERT_TRUE(eventually([&] { return count("catgs_sessions") == 0; })) << "the first has left";
  EXPECT_EQ(name_in(second->greet(hello("barn")).scene().scene_id()), "barn");
  EXPECT_FALSE(loaded("attic"));
  EXPECT_EQ(count("catgs_scenes_released_total"), 1);
  EXPECT_TRUE(loaded("city")) << "what --scene names stays";
}

TEST_F(SceneLibraryTest, AVisitorGoesFromSceneToScene) {
  start();
  const auto client = connect();
  EXPECT_EQ(name_in(client->greet(hello("city")).scene().scene_id()), "city");
  v1::ClientMessage select;
  select.mutable_select_scene()->set_scene_id("attic");
  client->send(select);
  EXPECT_EQ(
      name_in(client->receive_message(v1::ServerMessage::kWelcome).welcome().scene().scene_id()),
      "attic");
  client->send_pose(1);
  EXPECT_TRUE(client->receive_frame().header.idr());
}

TEST_F(SceneLibraryTest, RefusesWhatIsTooLargeOrBroken) {
  save_scene(random_cloud(9000, 3), folder_ / "palace.ply");
  // The header is as it should be; all Gaussians are not numbers.
  std::string broken = ply_bytes(random_cloud(50, 0));
  const auto data = broken.find("end_header\n") + 11;
  std::fill(broken.begin() + static_cast<std::ptrdiff_t>(data), broken.end(), '\xff');
  write("ruin.ply", broken);
  start();
  v1::Error error = refused("palace");
  EXPECT_EQ(error.code(), v1::Error::UNKNOWN_SCENE);
  EXPECT_THAT(error.message(), HasSubstr("needs 2.1 MB, more than --scene-memory allows"));
  error = refused("ruin");
  EXPECT_EQ(error.code(), v1::Error::UNKNOWN_SCENE);
  EXPECT_THAT(error.message(), HasSubstr("could not be loaded"));
  EXPECT_EQ(count("catgs_scene_loads_failed_total"), 1);
  const auto client = connect();
  EXPECT_EQ(name_in(client->greet(hello("attic")).scene().scene_id()), "attic")
      << "the others go on";
}

TEST_F(SceneLibraryTest, ServesAFolderAlone) {
  server_ = std::make_unique<RunningServer>([&](ServerConfig& config) {
    config.scenes.clear();
    config.scene_folders = {folder_.path()};
  });
  EXPECT_TRUE(loaded("attic")) << "a server that is up can show something";
  const auto client = connect();
  EXPECT_EQ(name_in(client->greet().scene().scene_id()), "attic");
}

TEST_F(SceneLibraryTest, AVisitorGoesOnWithTheTreeOfItsScene) {
  server_ = std::make_unique<RunningServer>([&](ServerConfig& config) {
    config.scene_folders = {folder_.path()};
    config.cache_dir = folder_ / "trees";
    config.gaussians_of_a_tree = 5000;
  });
  const double city_bytes = metric(*server_, "catgs_scene_bytes");
  const auto client = connect();
  client->greet(hello("attic"));
  client->send_pose(1);
  const ReceivedFrame first = client->receive_frame();
  EXPECT_TRUE(first.header.idr());
  client->send_ack(first.header.frame_id());
  ASSERT_TRUE(eventually([&] { return count("catgs_trees_built_total") == 1; }))
      << "a tree is built";
  const double pool_bytes = static_cast<double>(RendererOptions{}.scene_memory);
  ASSERT_TRUE(eventually([&] { return count("catgs_scene_bytes") == city_bytes + pool_bytes; }))
      << "nobody holds the whole scene any more";
  client->send_pose(2, 1.0f);
  for (bool seen = false; !seen;) {
    const Received received = client->receive();
    ASSERT_FALSE(received.closed);
    EXPECT_FALSE(received.message && received.message->has_welcome()) << "it is the same visit";
    if (received.frame) client->send_ack(received.frame->header.frame_id());
    seen = received.frame && received.frame->header.pose_id() == 2;
  }
}

/// As a part of a path: every byte that is no letter as %41.
std::string url_part(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += std::isalnum(static_cast<unsigned char>(c))
               ? std::string(1, c)
               : fmt::format("%{:02x}", static_cast<unsigned char>(c));
  return out;
}

TEST_F(SceneLibraryTest, EveryListedSceneOpensWhateverItsFileIsCalled) {
  const std::vector<std::string> names = {
      "colour\x1b[31m", "two\nlines",          "caf\xe9",
      "c1\xc2\x9b",     std::string(251, 'x'), "a?b#c%41%2f&+;=,:@!$(*)~^|`{}",
      "<b>\"'",         "back\\slash",         "a..",
      "Großmünster"};
  for (const std::string& name : names) write(name + ".ply", ply_bytes(random_cloud(5, 0)));
  server_ = std::make_unique<RunningServer>(
      [&](ServerConfig& config) { config.scene_folders = {folder_.path()}; });
  const auto scenes = listing();
  EXPECT_EQ(scenes.size(), names.size() + 3);
  for (const auto& scene : scenes) {
    const std::string id = scene.at("id");
    EXPECT_TRUE(is_scene_id(id)) << id;
    const auto client = connect();
    EXPECT_EQ(client->greet(hello(id)).scene().scene_id(), id);
    const std::string path = "/api/scenes/" + url_part(id);
    EXPECT_EQ(http_get(server_->port(), path + "/tours").status, 200) << id;
    EXPECT_EQ(http_get(server_->port(), path + "/poster.jpg").status, 200) << id;
  }
}

TEST_F(SceneLibraryTest, APosterIsPromisedUntilItsSceneHasBeenLoaded) {
  start();
  const auto poster = [&] { return http_get(server_->port(), "/api/scenes/attic/poster.jpg"); };
  const HttpReply first = poster();
  EXPECT_EQ(first.status, 202) << "no error, which a browser would report";
  EXPECT_EQ(first.headers.count("retry-after"), 1u);
  ASSERT_TRUE(eventually([&] { return poster().status == 200; })) << "the poster";
}

TEST_F(SceneLibraryTest, AServerStopsWhileItLoads) {
  save_scene(random_cloud(200'000, 3), folder_ / "large.ply");
  server_ = std::make_unique<RunningServer>(
      [&](ServerConfig& config) { config.scene_folders = {folder_.path()}; });
  const auto client = connect();
  client->send(hello("large"));
  client->receive_message(v1::ServerMessage::kQueue);
  server_->stop();
  client->receive_until_closed();
  server_->join();
}

}  // namespace
}  // namespace catgs::test
