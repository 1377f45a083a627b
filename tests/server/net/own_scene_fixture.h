#pragma once

// One server for all cases of a suite, each of which has a scene of its own.

#include <fmt/format.h>

#include "render_core/scene/files/save_scene.h"
#include "render_core/synth/synth.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::test {

class OwnSceneTest : public testing::Test {
 protected:
  static void TearDownTestSuite() {
    server.reset();
    folder.reset();
  }
  /// Makes the scenes, and no server.
  static void make_scenes() {
    folder = std::make_unique<TemporaryFolder>();
    next = 0;
    save_scene(synthesize(SynthKind::city, 2000, 1).cloud, *folder / file_of(0));
    for (int i = 1; i < scenes; ++i)
      std::filesystem::create_hard_link(*folder / file_of(0), *folder / file_of(i));
  }
  /// The scenes, a generated one beside them, and links.
  static void configure(ServerConfig& config) {
    config.scenes = {"synth:garden:2000"};
    for (int i = 0; i < scenes; ++i) config.scenes.push_back((*folder / file_of(i)).string());
    config.token_key_file = link_key_file();
  }
  OwnSceneTest() : hall(fmt::format("hall{}", next++)) {}

  /// The URL of a part of the scene.
  [[nodiscard]] std::string path_of(const std::string& part) const {
    return "/api/scenes/" + hall + "/" + part;
  }
  /// The head of an upload.
  [[nodiscard]] std::string head_of_put(const std::string& part, const std::string& by,
                                        std::size_t body_bytes) const {
    return fmt::format(
        "PUT {} HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {}\r\n"
        "Content-Length: {}\r\n\r\n",
        path_of(part), by, body_bytes);
  }

  static inline std::unique_ptr<TemporaryFolder> folder;
  static inline std::unique_ptr<RunningServer> server;
  const std::string hall;  // the scene's name

 private:
  static constexpr int scenes = 14;
  static inline int next = 0;
  static std::string file_of(int scene) { return fmt::format("hall{}.ply", scene); }
};

}  // namespace catgs::test
