#include "server/config/config.h"

#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

class ConfigTest : public testing::Test {
 protected:
  void read_toml(const std::string& text) {
    folder.write("server.toml", text);
    apply_toml(path, config, sources);
  }
  void read_environment(const std::map<std::string, std::string>& variables) {
    apply_environment(
        [&](const char* name) {
          const auto it = variables.find(name);
          return it == variables.end() ? nullptr : it->second.c_str();
        },
        config, sources);
  }
  void read_flag(const std::string& name, const std::vector<std::string>& values) {
    const auto it = std::ranges::find(settings(), name, &Setting::name);
    ASSERT_NE(it, settings().end());
    apply_flag(*it, values, config, sources);
  }

  const test::TemporaryFolder folder;
  const std::string path = folder / "server.toml";
  ServerConfig config;
  ConfigSources sources;
};

TEST_F(ConfigTest, LaterLayersWin) {
  read_toml("port = 1000\nfps = 30\nscene = [\"a.ply\", \"b.ply\"]\nopen = true\n");
  EXPECT_EQ(config.port, 1000);
  EXPECT_TRUE(config.open);
  EXPECT_THAT(config.scenes, ElementsAre("a.ply", "b.ply"));
  read_environment({{"CATGS_PORT", "2000"}, {"CATGS_SCENE", "c.ply,d.ply"}});
  EXPECT_EQ(config.port, 2000);
  EXPECT_THAT(config.scenes, ElementsAre("c.ply", "d.ply"));
  read_flag("port", {"3000"});
  EXPECT_EQ(config.port, 3000);
  EXPECT_EQ(config.fps, 30);
  EXPECT_THAT(print_config(config, sources),
              AllOf(HasSubstr("port = 3000  # --port\n"), HasSubstr("fps = 30  # " + path + ":2\n"),
                    HasSubstr("scene = [\"c.ply\", \"d.ply\"]  # CATGS_SCENE\n"),
                    HasSubstr("bitrate = 8000  # default\n")));
}

TEST_F(ConfigTest, PrintedConfigReadsBackTheSame) {
  read_flag("scene", {"with \"quotes\".ply", "back\\slash.ply"});
  read_flag("encoder", {"jpeg"});
  const std::string printed = print_config(config, sources);
  ServerConfig again;
  ConfigSources ignored;
  folder.write("server.toml", printed);
  apply_toml(path, again, ignored);
  EXPECT_EQ(again.scenes, config.scenes);
  EXPECT_EQ(again.encoder, EncoderKind::jpeg);
  EXPECT_EQ(again.admin_bind, config.admin_bind);
}

TEST_F(ConfigTest, MistakesNameTheirPlace) {
  EXPECT_THAT([&] { read_toml("port = 80\nfsp = 30\n"); },
              ThrowsMessage<InputError>(AllOf(HasSubstr(path + ":2"), HasSubstr("fsp"))));
  EXPECT_THAT([&] { read_toml("\n\nport = \"x\"\n"); },
              ThrowsMessage<InputError>(AllOf(HasSubstr(path + ":3"), HasSubstr("port"))));
  EXPECT_THAT([&] { read_toml("port = [\n"); }, ThrowsMessage<InputError>(HasSubstr(path)));
  EXPECT_THAT([&] { read_toml("port = 1.5\n"); }, ThrowsMessage<InputError>(HasSubstr(":1")));
  EXPECT_THAT(
      [&] {
        read_environment({{"CATGS_FPS", "0"}});
      },
      ThrowsMessage<InputError>(
          testing::StartsWith("CATGS_FPS: \"0\" is not a whole number in 1…240")));
  EXPECT_THAT([&] { read_flag("encoder", {"vp9"}); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("--encoder"), HasSubstr("x264"))));
  EXPECT_THAT([&] { read_flag("admin-bind", {"9090"}); },
              ThrowsMessage<InputError>(HasSubstr("ADDRESS:PORT")));
  EXPECT_THAT([&] { apply_toml("/nowhere.toml", config, sources); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("--config /nowhere.toml"),
                                              HasSubstr("No such file"), HasSubstr("check"))));
}

TEST_F(ConfigTest, AMistypedNameGetsTheNearest) {
  EXPECT_THAT([&] { read_toml("max_session = 4\n"); },
              ThrowsMessage<InputError>(AllOf(HasSubstr(path + ":1: max_session"),
                                              HasSubstr("did you mean max-sessions?"))));
  EXPECT_THAT([&] { read_toml("colour = 4\n"); },
              ThrowsMessage<InputError>(HasSubstr("--help lists them")));
}

TEST_F(ConfigTest, VariablesThatAreNoSettingsAreTold) {
  EXPECT_EQ(unknown_variables({"PATH", "CATGS_PORT", "CATGS_CONFIG", "CATGS_MAX_SESSIONS"}), "");
  EXPECT_EQ(unknown_variables({"CATGS_MAX_SESSION", "CATGS_BUILD_TREE", "CATGS_port"}),
            "CATGS_MAX_SESSION (did you mean CATGS_MAX_SESSIONS?), CATGS_BUILD_TREE, "
            "CATGS_port (did you mean CATGS_PORT?)");
}

TEST_F(ConfigTest, OriginsAreAsBrowsersWriteThem) {
  const std::map<std::string, std::string> mistakes = {
      {"null", "allow-same-origin"},
      {"example.com", "did you mean https://example.com?"},
      {"example.com:8443/", "did you mean https://example.com:8443?"},
      {"https://example.com/", "did you mean https://example.com?"},
      {"https://Example.com:443", "did you mean https://example.com?"},
      {"http://example.com:80/tour?a#b", "did you mean http://example.com?"},
      {"https://", "is no origin"},
      {"https://a.example; script-src *", "is no origin"},
      {"https://a.example https://b.example", "is no origin"}};
  for (const char* name : {"allow-origin", "embed-origin"}) {
    for (const auto& [text, remedy] : mistakes)
      EXPECT_THAT(
          [&] {
            read_flag(name, {"https://good.example", text});
          },
          ThrowsMessage<InputError>(AllOf(HasSubstr(name), HasSubstr(remedy))))
          << text;
    for (const char* good :
         {"*", "https://a.example", "http://127.0.0.1:8080", "https://[::1]:8443",
          "http://localhost:5173", "chrome-extension://abcdefgh"})
      EXPECT_NO_THROW(read_flag(name, {good})) << good;
  }
  read_flag("embed-origin", {"https://*.a.example"});
  EXPECT_THAT(config.embed_origins, ElementsAre("https://*.a.example"));
  EXPECT_THAT([&] { read_flag("allow-origin", {"https://*.a.example"}); },
              ThrowsMessage<InputError>(HasSubstr("is no origin")));
}

TEST_F(ConfigTest, SitesOfMediaSpeakHttps) {
  read_flag("media-origin", {"https://media.example", "https://a.example:8443"});
  EXPECT_THAT(config.media_origins, ElementsAre("https://media.example", "https://a.example:8443"));
  EXPECT_THAT([&] { read_flag("media-origin", {"http://media.example"}); },
              ThrowsMessage<InputError>(HasSubstr("is no https site")));
  for (const char* other : {"*", "https://*.example", "https://a.example/", "data:", "'self'"})
    EXPECT_THROW(read_flag("media-origin", {other}), InputError) << other;
}

TEST_F(ConfigTest, SitesThatEachAnswerNamesAreFew) {
  config.scenes = {"synth:city:1000"};
  for (int i = 0; i < 10; ++i)
    config.media_origins.push_back("https://media" + std::to_string(i) + ".example");
  EXPECT_NO_THROW(validate(config));
  config.embed_origins.assign(60, "https://museum.of.a.long.name.example");
  EXPECT_THAT(
      [&] { validate(config); },
      ThrowsMessage<InputError>(AllOf(HasSubstr("--embed-origin"), HasSubstr("name fewer sites"))));
}

TEST_F(ConfigTest, RefusesAnOpenDoor) {
  config.scenes = {"synth:city:1000"};
  EXPECT_NO_THROW(validate(config));
  config.bind = "0.0.0.0";
  EXPECT_THAT([&] { validate(config); }, ThrowsMessage<InputError>(HasSubstr("--open")));
  config.open = true;
  EXPECT_NO_THROW(validate(config));
  config.open = false;
  config.token_file = "tokens";
  EXPECT_NO_THROW(validate(config));
}

TEST_F(ConfigTest, RefusesAListOfLinksWithoutTheirKey) {
  config.scenes = {"synth:city:1000"};
  config.revoked_links = "revoked";
  EXPECT_THAT([&] { validate(config); }, ThrowsMessage<InputError>(HasSubstr("--token-key-file")));
  config.token_key_file = "key";
  EXPECT_NO_THROW(validate(config));
}

TEST_F(ConfigTest, RefusesAnOpenAdminDoorEvenWithTokens) {
  config.scenes = {"synth:city:1000"};
  config.bind = "0.0.0.0";
  config.token_file = "tokens";
  config.admin_bind = "0.0.0.0:9090";
  EXPECT_THAT([&] { validate(config); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("--admin-bind 0.0.0.0:9090"),
                                              HasSubstr("no token"), HasSubstr("--admin-open"))));
  for (const char* closed : {"off", "127.0.0.1:9090", "[::1]:9090", "localhost:9090"}) {
    config.admin_bind = closed;
    EXPECT_NO_THROW(validate(config)) << closed;
  }
  config.admin_bind = "[::]:9090";
  EXPECT_THROW(validate(config), InputError);
  config.open = true;
  EXPECT_NO_THROW(validate(config));
  config.open = false;
  config.admin_open = true;
  EXPECT_NO_THROW(validate(config));
  config.token_file.clear();
  EXPECT_THROW(validate(config), InputError) << "it opens the metrics, not the page";
}

TEST_F(ConfigTest, PageAndMetricsNeedPortsOfTheirOwn) {
  config.scenes = {"synth:city:1000"};
  config.port = 9090;
  for (const char* same : {"127.0.0.1:9090", "[::1]:9090"}) {
    config.admin_bind = same;
    EXPECT_THAT([&] { validate(config); },
                ThrowsMessage<InputError>(AllOf(HasSubstr("--port 9090"), HasSubstr(same),
                                                HasSubstr("--admin-bind off"))));
  }
  config.admin_bind = "off";
  EXPECT_NO_THROW(validate(config));
  config.port = 0;  // the system chooses two
  config.admin_bind = "127.0.0.1:0";
  EXPECT_NO_THROW(validate(config));
}

TEST_F(ConfigTest, LevelAndBudgetExcludeEachOther) {
  read_toml("scene = \"tour\"\nlod = 2\n");
  EXPECT_NO_THROW(validate(config));
  read_environment({{"CATGS_BUDGET", "1000000"}});
  EXPECT_THAT([&] { validate(config); }, ThrowsMessage<InputError>(HasSubstr("--lod, --budget")));
  read_flag("lod", {"-1"});
  EXPECT_NO_THROW(validate(config));
  EXPECT_EQ(config.gaussian_budget, 1'000'000);
}

TEST_F(ConfigTest, TreesAreNotKeptAmongScenes) {
  config.scene_folders = {folder.path()};
  config.cache_dir = folder / ".";
  EXPECT_THAT(
      [&] { validate(config); },
      ThrowsMessage<InputError>(AllOf(HasSubstr("--cache-dir"), HasSubstr("--scene-folder"))));
  config.cache_dir = folder / "trees";
  EXPECT_NO_THROW(validate(config));
}

TEST_F(ConfigTest, NoSessionIsPromisedMoreThanItsNominalRate) {
  read_toml("scene = \"a.ply\"\nfps = 5\n");
  EXPECT_NO_THROW(validate(config, sources)) << "the default of min-fps contradicts nothing";
  read_flag("min-fps", {"6"});
  EXPECT_THAT([&] { validate(config, sources); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("--min-fps 6"), HasSubstr("--fps 5"))));
  read_flag("min-fps", {"5"});
  EXPECT_NO_THROW(validate(config, sources));
}

TEST_F(ConfigTest, DevicesAreAListInEveryLayer) {
  EXPECT_THAT(print_config(config, sources), HasSubstr("device = \"all\"  # default\n"));
  read_toml("device = [1, 0]\nscene = \"a.ply\"\n");
  EXPECT_THAT(config.devices, ElementsAre(1, 0));
  EXPECT_THAT(print_config(config, sources), HasSubstr("device = \"1,0\"  # " + path + ":1\n"));
  read_toml("device = 3\n");
  EXPECT_THAT(config.devices, ElementsAre(3));
  read_environment({{"CATGS_DEVICE", "0,1"}});
  EXPECT_THAT(config.devices, ElementsAre(0, 1));
  EXPECT_THAT([&] { read_toml("\ndevice = [0, 0]\n"); },
              ThrowsMessage<InputError>(AllOf(HasSubstr(path + ":2: device"), HasSubstr("twice"))));
  EXPECT_THAT([&] { read_flag("device", {"gpu"}); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("--device"), HasSubstr("like 0 or 0,1"))));
  EXPECT_NO_THROW(validate(config));
  config.renderer = RendererKind::cpu;
  EXPECT_THAT([&] { validate(config); },
              ThrowsMessage<InputError>(HasSubstr("leave one of them out")));
  read_flag("device", {"all"});
  EXPECT_NO_THROW(validate(config));
}

TEST_F(ConfigTest, RefusesHalfATlsPairAndNoScene) {
  EXPECT_THAT([&] { validate(config); }, ThrowsMessage<InputError>(HasSubstr("--scene")));
  config.scenes = {"a.ply"};
  config.tls_cert = "cert.pem";
  EXPECT_THAT([&] { validate(config); }, ThrowsMessage<InputError>(HasSubstr("--tls-key")));
}

TEST(Endpoint, IsAddressAndPort) {
  EXPECT_EQ(parse_endpoint("[::1]:9090").address, "::1");
  EXPECT_EQ(parse_endpoint("127.0.0.1:0").port, 0);
  EXPECT_THROW(parse_endpoint(":80"), std::invalid_argument);
  EXPECT_THROW(parse_endpoint("host:99999"), std::invalid_argument);
}

}  // namespace
}  // namespace catgs
