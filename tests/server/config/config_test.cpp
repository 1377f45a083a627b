#include "server/config/config.h"

#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

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

  /// The setting and place that a refusal names; empty: the configuration is valid.
  std::string mistake() {
    return test::refused_field([&] { validate(config, sources); });
  }
  /// With the line of the file.
  std::string mistake_in(const std::string& toml) {
    try {
      read_toml(toml);
    } catch (const InputError& error) {
      return error.source() + ": " + error.where();
    }
    return "";
  }
  std::string mistake_of(const std::string& flag, const std::vector<std::string>& values) {
    return test::refused_field([&] { read_flag(flag, values); });
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
  read_flag("quality-ladder", {"off"});
  read_flag("x264-aq", {"1.25"});
  const std::string printed = print_config(config, sources);
  ServerConfig again;
  ConfigSources ignored;
  folder.write("server.toml", printed);
  apply_toml(path, again, ignored);
  EXPECT_EQ(again.scenes, config.scenes);
  EXPECT_EQ(again.encoder, EncoderKind::jpeg);
  EXPECT_TRUE(again.forecasts);
  EXPECT_FALSE(again.quality_ladder);
  EXPECT_EQ(again.x264_aq, 1.25);
  EXPECT_EQ(again.admin_bind, config.admin_bind);
}

TEST_F(ConfigTest, MistakesNameTheirPlace) {
  EXPECT_EQ(mistake_in("port = 80\nfsp = 30\n"), path + ":2: fsp");
  EXPECT_EQ(mistake_in("\n\nport = \"x\"\n"), path + ":3: port");
  EXPECT_THAT(mistake_in("port = [\n"), StartsWith(path + ":"));
  EXPECT_EQ(mistake_in("port = 1.5\n"), path + ":1: port");
  EXPECT_EQ(test::refused_field([&] { read_environment({{"CATGS_FPS", "0"}}); }), "CATGS_FPS");
  EXPECT_EQ(mistake_of("encoder", {"vp9"}), "--encoder");
  EXPECT_EQ(mistake_of("forecasts", {"true"}), "--forecasts");
  EXPECT_EQ(mistake_of("admin-bind", {"9090"}), "--admin-bind");
  EXPECT_EQ(test::refused_field([&] { apply_toml("/nowhere.toml", config, sources); }),
            "--config /nowhere.toml");
}

TEST_F(ConfigTest, MistakesAreSaidWithTheirRemedy) {
  const auto says = [](const std::string& text) {
    return ThrowsMessage<InputError>(HasSubstr(text));
  };
  EXPECT_THAT([&] { read_flag("fps", {"0"}); }, says("\"0\" is not a whole number in 1…240"));
  EXPECT_THAT([&] { read_toml("max_session = 4\n"); }, says("did you mean max-sessions?"));
  EXPECT_THAT([&] { read_toml("colour = 4\n"); }, says("--help lists them"));
  EXPECT_THAT([&] { read_flag("allow-origin", {"example.com:8443/"}); },
              says("did you mean https://example.com:8443?"));
}

TEST_F(ConfigTest, VariablesThatAreNoSettingsAreTold) {
  EXPECT_EQ(unknown_variables({"PATH", "CATGS_PORT", "CATGS_CONFIG", "CATGS_MAX_SESSIONS"}), "");
  EXPECT_EQ(unknown_variables({"CATGS_MAX_SESSION", "CATGS_BUILD_TREE", "CATGS_port"}),
            "CATGS_MAX_SESSION (did you mean CATGS_MAX_SESSIONS?), CATGS_BUILD_TREE, "
            "CATGS_port (did you mean CATGS_PORT?)");
}

TEST_F(ConfigTest, OriginsAreAsBrowsersWriteThem) {
  for (const char* name : {"allow-origin", "embed-origin"}) {
    for (const char* bad :
         {"null", "example.com", "example.com:8443/", "https://example.com/",
          "https://Example.com:443", "http://example.com:80/tour?a#b", "https://",
          "https://a.example; script-src *", "https://a.example https://b.example"})
      EXPECT_EQ(mistake_of(name, {"https://good.example", bad}), std::string("--") + name) << bad;
    for (const char* good :
         {"*", "https://a.example", "http://127.0.0.1:8080", "https://[::1]:8443",
          "http://localhost:5173", "chrome-extension://abcdefgh"})
      EXPECT_EQ(mistake_of(name, {good}), "") << good;
  }
  read_flag("embed-origin", {"https://*.a.example"});
  EXPECT_THAT(config.embed_origins, ElementsAre("https://*.a.example"));
  EXPECT_EQ(mistake_of("allow-origin", {"https://*.a.example"}), "--allow-origin");
}

TEST_F(ConfigTest, SitesOfMediaSpeakHttps) {
  read_flag("media-origin", {"https://media.example", "https://a.example:8443"});
  EXPECT_THAT(config.media_origins, ElementsAre("https://media.example", "https://a.example:8443"));
  for (const char* other :
       {"http://media.example", "*", "https://*.example", "https://a.example/", "data:", "'self'"})
    EXPECT_EQ(mistake_of("media-origin", {other}), "--media-origin") << other;
}

TEST_F(ConfigTest, SitesThatEachAnswerNamesAreFew) {
  config.scenes = {"synth:city:1000"};
  for (int i = 0; i < 10; ++i)
    config.media_origins.push_back("https://media" + std::to_string(i) + ".example");
  EXPECT_EQ(mistake(), "");
  config.embed_origins.assign(60, "https://museum.of.a.long.name.example");
  EXPECT_EQ(mistake(), "--media-origin, --embed-origin");
}

/// Each with a scene and what else the case sets.
TEST_F(ConfigTest, SettingsThatContradictEachOtherAreRefused) {
  struct Case {
    std::function<void(ServerConfig&)> set;
    std::string field;
  };
  const std::vector<Case> cases = {
      {[](auto&) {}, ""},
      {[](auto& c) { c.bind = "0.0.0.0"; }, "--bind 0.0.0.0"},
      {[](auto& c) { c.bind = "0.0.0.0", c.open = true; }, ""},
      {[](auto& c) { c.bind = "127.0.0.1:9501"; }, "--bind 127.0.0.1:9501"},
      {[](auto& c) { c.bind = "[::1]:9501"; }, "--bind [::1]:9501"},
      {[](auto& c) { c.bind = "::1"; }, ""},
      {[](auto& c) { c.bind = "0.0.0.0", c.token_file = "tokens"; }, ""},
      {[](auto& c) { c.revoked_links = "revoked"; }, "--revoked-links"},
      {[](auto& c) { c.revoked_links = "revoked", c.token_key_file = "key"; }, ""},
      {[](auto& c) { c.tls_cert = "cert.pem"; }, "--tls-key"},
      {[](auto& c) { c.tls_key = "key.pem"; }, "--tls-cert"},
      {[](auto& c) { c.scenes.clear(); }, "--scene"},
      {[](auto& c) { c.lod = 2; }, ""},
      {[](auto& c) { c.gaussian_budget = 1'000'000; }, ""},
      {[](auto& c) { c.lod = 2, c.gaussian_budget = 1'000'000; }, "--lod, --budget"},
      {[](auto& c) { c.port = 9090, c.admin_bind = "off"; }, ""},
      {[](auto& c) { c.port = 0, c.admin_bind = "127.0.0.1:0"; }, ""},  // the system chooses two
      {[](auto& c) { c.port = 9090, c.admin_bind = "[::1]:9090"; },
       "--port 9090, --admin-bind [::1]:9090"},
      {[](auto& c) { c.port = 9090, c.admin_bind = "127.0.0.1:9090"; },
       "--port 9090, --admin-bind 127.0.0.1:9090"}};
  for (std::size_t i = 0; i < cases.size(); ++i) {
    config = {};
    config.scenes = {"synth:city:1000"};
    cases[i].set(config);
    EXPECT_EQ(mistake(), cases[i].field) << "case " << i;
  }
}

TEST_F(ConfigTest, RefusesAnOpenAdminPortEvenWithTokens) {
  config.scenes = {"synth:city:1000"};
  config.bind = "0.0.0.0";
  config.token_file = "tokens";
  for (const char* closed : {"off", "127.0.0.1:9090", "[::1]:9090", "localhost:9090"}) {
    config.admin_bind = closed;
    EXPECT_EQ(mistake(), "") << closed;
  }
  for (const std::string open : {"0.0.0.0:9090", "[::]:9090"}) {
    config.admin_bind = open;
    EXPECT_EQ(mistake(), "--admin-bind " + open);
  }
  config.open = true;
  EXPECT_EQ(mistake(), "");
  config.open = false;
  config.admin_open = true;
  EXPECT_EQ(mistake(), "");
  config.token_file.clear();
  EXPECT_EQ(mistake(), "--bind 0.0.0.0") << "it opens the metrics, not the page";
}

TEST_F(ConfigTest, LaterLayersMayEndAContradiction) {
  read_toml("scene = \"tour\"\nlod = 2\n");
  read_environment({{"CATGS_BUDGET", "1000000"}});
  EXPECT_EQ(mistake(), "--lod, --budget");
  read_flag("lod", {"-1"});
  EXPECT_EQ(mistake(), "");
  EXPECT_EQ(config.gaussian_budget, 1'000'000);
}

TEST_F(ConfigTest, TreesAreNotKeptAmongScenes) {
  config.scene_folders = {folder.path()};
  config.cache_dir = folder / ".";
  EXPECT_EQ(mistake(), "--cache-dir " + config.cache_dir);
  config.cache_dir = folder / "trees";
  EXPECT_EQ(mistake(), "");
}

TEST_F(ConfigTest, NoSessionIsPromisedMoreThanItsNominalRate) {
  read_toml("scene = \"a.ply\"\nfps = 5\n");
  EXPECT_EQ(mistake(), "") << "the default of min-fps contradicts nothing";
  read_flag("min-fps", {"6"});
  EXPECT_EQ(mistake(), "--min-fps 6");
  read_flag("min-fps", {"5"});
  EXPECT_EQ(mistake(), "");
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
  EXPECT_EQ(mistake_in("\ndevice = [0, 0]\n"), path + ":2: device");
  EXPECT_EQ(mistake_of("device", {"gpu"}), "--device");
  EXPECT_EQ(mistake(), "");
  config.renderer = RendererKind::cpu;
  EXPECT_EQ(mistake(), "--device");
  read_flag("device", {"all"});
  EXPECT_EQ(mistake(), "");
}

TEST(Endpoint, IsAddressAndPort) {
  EXPECT_EQ(parse_endpoint("[::1]:9090").address, "::1");
  EXPECT_EQ(parse_endpoint("127.0.0.1:0").port, 0);
  EXPECT_THROW(parse_endpoint(":80"), std::invalid_argument);
  EXPECT_THROW(parse_endpoint("host:99999"), std::invalid_argument);
}

}  // namespace
}  // namespace catgs
