#include "server/scenes/tours.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include "render_core/base/error.h"
#include "render_core/scene/files/save_scene.h"
#include "server/net/http.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class Tours : public FolderTest {
 protected:
  void SetUp() override { save_scene(random_cloud(30, 0), folder_ / "museum.splat"); }
  nlohmann::json read() {
    return nlohmann::json::parse(
        tours_of(folder_ / "museum.json", sidecar_text(folder_ / "museum.json")));
  }
};

TEST_F(Tours, AreEmptyWithoutFiles) {
  EXPECT_TRUE(read()["tours"].is_null());
  EXPECT_TRUE(read()["settings"].is_null());
  EXPECT_TRUE(read()["etag"].is_null());
  EXPECT_FALSE(sidecar_text(folder_ / "museum.json"));
}

TEST_F(Tours, ComeFromTheSidecarAndTheViewersSettings) {
  write("museum.json", R"({"up": "-y", "tours": [{"title": "Hall"}]})");
  write("settings.json", R"({"version": 2, "animTracks": [], "annotations": [{"title": "Door"}]})");
  EXPECT_EQ(read()["tours"][0]["title"], "Hall");
  EXPECT_EQ(read()["settings"]["annotations"][0]["title"], "Door");
  EXPECT_EQ(read()["etag"], etag_of(sidecar_text(folder_ / "museum.json").value()));
  write("museum.settings.json", R"({"version": 2, "animTracks": [1]})");
  EXPECT_EQ(read()["settings"]["animTracks"].size(), 1u) << "the scene's own come first";
}

TEST_F(Tours, OfATextAreThoseOfThatTextWhateverIsOnTheDisk) {
  write("museum.json", R"({"tours": [{"title": "Hall"}]})");
  const std::string newer(R"({"tours": [{"title": "Tower"}]})");
  const auto document = nlohmann::json::parse(tours_of(folder_ / "museum.json", newer));
  EXPECT_EQ(document["tours"][0]["title"], "Tower");
  EXPECT_EQ(document["etag"], etag_of(newer));
  EXPECT_TRUE(nlohmann::json::parse(tours_of(folder_ / "museum.json", {}))["tours"].is_null());
}

TEST_F(Tours, AreAnsweredWithWhetherTheyMayBeSaved) {
  const ToursAnswers answers(R"({"tours":[]})");
  EXPECT_EQ(*answers.for_viewers, R"({"may_save":false,"document":{"tours":[]}})");
  EXPECT_EQ(*answers.for_authors, R"({"may_save":true,"document":{"tours":[]}})");
}

TEST_F(Tours, LeaveForeignAndBrokenSettingsAlone) {
  write("museum.settings.json", "{ broken");
  write("settings.json", R"({"editor.fontSize": 12})");
  EXPECT_TRUE(read()["settings"].is_null());
}

TEST_F(Tours, RefuseWhatIsNestedWithoutEnd) {
  const std::string deep = std::string(1'000'000, '[') + std::string(1'000'000, ']');
  write("museum.settings.json", R"({"animTracks": 1, "a": )" + deep + "}");
  EXPECT_TRUE(read()["settings"].is_null());
  write("museum.json", R"({"tours": )" + deep + "}");
  EXPECT_THAT([&] { tours_of(folder_ / "museum.json", sidecar_text(folder_ / "museum.json")); },
              ThrowsMessage<std::runtime_error>(HasSubstr("nested deeper than 256")));
}

TEST_F(Tours, AreRefusedBeyondFourMebibytes) {
  const auto padded = [](std::size_t bytes, std::string text) {
    text.resize(bytes, ' ');
    return text;
  };
  write("museum.settings.json", padded(4 << 20, R"({"animTracks": 1})"));
  EXPECT_FALSE(read()["settings"].is_null());
  write("museum.settings.json", padded((4 << 20) + 1, R"({"animTracks": 1})"));
  EXPECT_TRUE(read()["settings"].is_null());
  write("museum.json", padded(4 << 20, R"({"tours": []})"));
  EXPECT_FALSE(read()["tours"].is_null());
  write("museum.json", padded((4 << 20) + 1, R"({"tours": []})"));
  EXPECT_THAT([&] { read(); },
              ThrowsMessage<std::runtime_error>(HasSubstr("at most 4194304 make sense")));
}

TEST_F(Tours, SayWhatIsWrongInASidecar) {
  write("museum.json", R"({"tours": {"title": "Hall"}})");
  EXPECT_THAT([&] { tours_of(folder_ / "museum.json", sidecar_text(folder_ / "museum.json")); },
              ThrowsMessage<std::runtime_error>(HasSubstr("tours: is not an array")));
}

TEST_F(Tours, WithAMistakeAreServedAndLogged) {
  std::ostringstream log;
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(
      "tours test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)));
  const auto show = [&](const std::string& stop) {
    log.str("");
    write("museum.json", fmt::format(R"({{"tours": [{{"stops": [{}]}}]}})", stop));
    return read()["tours"][0]["stops"].size();
  };
  EXPECT_EQ(show(R"({"position": [0, 0, 0], "look_at": [0, 0, 1]})"), 1u);
  EXPECT_EQ(log.str(), "");
  EXPECT_EQ(show(R"({"position": [0, 0, 0], "look_at": [0, 0, 1], "titel": "Door"})"), 1u);
  EXPECT_THAT(log.str(), AllOf(HasSubstr("museum.json: tours[0].stops[0]: unknown field 'titel'"),
                               HasSubstr("known are title")));
  show(R"({"position": [0, 0, 0], "look_at": [0, 0, 1],
           "media": [{"src": "https://media.example/a.mp4"}]})");
  EXPECT_THAT(log.str(), HasSubstr("--media-origin"));
  spdlog::set_default_logger(before);
}

constexpr std::string_view stop = R"({"position": [0, 1, 2], "look_at": [0, 1, 3])";

std::string with_stop(const std::string& more) {
  return fmt::format(R"({{"tours": [{{"title": "Hall", "stops": [{}{}}}]}}]}})", stop, more);
}

TEST(SentSidecar, OfAWholeTourIsTaken) {
  const Sidecar sidecar = check_sent_sidecar(
      R"({"up": "-y", "near": 0.1, "tours": [{"title": "Hall", "autoplay": true, "stops": [
          {"title": "Door", "caption": "Oak.", "position": [1, 2, 3], "orientation": [0, 0, 0, 1],
           "fov_deg": 60, "marker": [1, 2, 4], "stay_s": 8, "fly_s": 2}]}]})");
  EXPECT_FLOAT_EQ(sidecar.near_z.value(), 0.1f);
  EXPECT_NO_THROW(check_sent_sidecar(with_stop("")));
  EXPECT_NO_THROW(check_sent_sidecar("{}"));
}

TEST(SentSidecar, PortalsLeadToAViewAStopOrTheStartOfAScene) {
  for (const char* portal :
       {R"({"scene": "hall"})", R"({"scene": "hall-kdfmqrtv", "tour": 2, "stop": 256})",
        R"({"scene": "hall", "position": [1, 2, 3], "look_at": [0, 0, 0], "fov_deg": 50})",
        R"({"scene": "hall", "position": [1, 2, 3], "orientation": [0, 0, 0, 1]})"})
    EXPECT_NO_THROW(check_sent_sidecar(with_stop(fmt::format(R"(, "portal": {})", portal))))
        << portal;
}

std::string mistake(const std::string& json) {
  try {
    check_sent_sidecar(json);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(SentSidecar, OfAPortalIsRefusedByTheFieldThatIsWrong) {
  const auto of = [](std::string_view portal) {
    return mistake(with_stop(fmt::format(R"(, "portal": {})", portal)));
  };
  EXPECT_THAT(of("7"), HasSubstr("portal: is not an object"));
  EXPECT_THAT(of("{}"), HasSubstr("'scene' is missing"));
  EXPECT_THAT(of(R"({"scene": ""})"), HasSubstr("portal.scene: is not 1 to 128 bytes"));
  EXPECT_THAT(of(fmt::format(R"({{"scene": "{}"}})", std::string(129, 'a'))),
              HasSubstr("portal.scene: is not 1 to 128 bytes"));
  EXPECT_THAT(of(R"({"scene": "hall", "where": 1})"), HasSubstr("unknown field 'where'"));
  EXPECT_THAT(of(R"({"scene": "hall", "stop": 0})"), HasSubstr("portal.stop: is not in 1"));
  EXPECT_THAT(of(R"({"scene": "hall", "stop": 257})"), HasSubstr("portal.stop: is not in 1"));
  EXPECT_THAT(of(R"({"scene": "hall", "tour": 1.5})"), HasSubstr("tour: is no whole number"));
  EXPECT_THAT(of(R"({"scene": "hall", "position": [0, 0, 0]})"), HasSubstr("orientation"));
  EXPECT_THAT(of(R"({"scene": "hall", "stop": 1, "position": [0, 0, 0], "look_at": [0, 0, 1]})"),
              HasSubstr("leads to a view and to a stop"));
  for (const char* part : {R"("look_at": [0, 0, 1])", R"("orientation": [0, 0, 0, 1])",
                           R"("fov_deg": 50)", R"("look_at": "nowhere")"}) {
    EXPECT_THAT(of(fmt::format(R"({{"scene": "hall", {}}})", part)),
                HasSubstr("'position' is missing"))
        << part;
    EXPECT_THAT(of(fmt::format(R"({{"scene": "hall", "tour": 1, {}}})", part)),
                HasSubstr("leads to a view and to a stop"))
        << part;
  }
}

TEST(SentSidecar, IsRefusedByTheFieldThatIsWrong) {
  EXPECT_THAT(mistake("{ broken"), HasSubstr("sidecar: byte "));
  EXPECT_THAT(mistake("[]"), HasSubstr("is not a JSON object"));
  EXPECT_THAT(mistake(R"({"near": -1})"), HasSubstr("near: is not positive"));
  EXPECT_THAT(mistake(R"({"start_pose":{"position":[3e38,3e38,3e38],"look_at":[0,0,0]}})"),
              HasSubstr("start_pose.position: is not a position"));
  EXPECT_THAT(mistake(R"({"poster": 1})"), HasSubstr("unknown field 'poster'"));
  EXPECT_THAT(mistake(R"({"tours": {}})"), HasSubstr("tours: is not an array"));
  EXPECT_THAT(mistake(R"({"tours": [1]})"), HasSubstr("tours[0]: is not an object"));
  EXPECT_THAT(mistake(R"({"tours": [{"title": "Hall"}]})"), HasSubstr("'stops' is missing"));
  EXPECT_THAT(mistake(R"({"tours": [{"stops": [], "autoplay": 1}]})"),
              HasSubstr("tours[0].autoplay"));
  EXPECT_THAT(mistake(with_stop(R"(, "fov_deg": 400)")), HasSubstr("tours[0].stops[0].fov_deg"));
  EXPECT_THAT(mistake(with_stop(R"(, "stay_s": -1)")), HasSubstr("stay_s: is not in 0"));
  EXPECT_THAT(mistake(with_stop(R"(, "fly_s": 121)")), HasSubstr("fly_s: is not in 0"));
  EXPECT_THAT(mistake(with_stop(R"(, "marker": [0, 0])")), HasSubstr("marker"));
  EXPECT_THAT(mistake(with_stop(R"(, "captoin": "x")")), HasSubstr("unknown field 'captoin'"));
  EXPECT_THAT(mistake(with_stop(R"(, "caption": 7)")), HasSubstr("caption: is not a text"));
  const auto caption = [](std::size_t bytes) {
    return with_stop(fmt::format(R"(, "caption": "{}")", std::string(bytes, 'x')));
  };
  EXPECT_EQ(mistake(caption(16'000)), "");
  EXPECT_THAT(mistake(caption(16'001)), HasSubstr("caption: has more than"));
  EXPECT_THAT(mistake(R"({"tours": [{"stops": [{"position": [0, 0, 0]}]}]})"),
              HasSubstr("stops[0]: 'look_at' or 'orientation' is missing"));
  const auto turned = [](const char* orientation) {
    return fmt::format(
        R"({{"tours": [{{"stops": [{{"position": [0, 0, 0], "orientation": {}}}]}}]}})",
        orientation);
  };
  EXPECT_EQ(mistake(turned("[0, 0, 0.995, 0]")), "") << "pages round them";
  EXPECT_THAT(mistake(turned("[0, 0, 0, 0]")),
              HasSubstr("tours[0].stops[0].orientation: is no quaternion"));
  const auto tours = [](std::size_t count) {
    const std::vector<std::string> all(count, R"({"stops": []})");
    return fmt::format(R"({{"tours": [{}]}})", fmt::join(all, ","));
  };
  EXPECT_EQ(mistake(tours(32)), "");
  EXPECT_THAT(mistake(tours(33)), HasSubstr("tours: has 33 entries, at most 32"));
  const auto stops = [](std::size_t count) {
    const std::vector<std::string> all(count, std::string(stop) + "}");
    return fmt::format(R"({{"tours": [{{"stops": [{}]}}]}})", fmt::join(all, ","));
  };
  EXPECT_EQ(mistake(stops(256)), "");
  EXPECT_THAT(mistake(stops(257)), HasSubstr("tours[0].stops: has 257 entries, at most 256"));
  EXPECT_EQ(mistake(std::string((1 << 20) - 2, ' ') + "{}"), "");
  EXPECT_NE(mistake(std::string((1 << 20) - 1, ' ') + "{}"), "") << "too large";
}

TEST(SentSidecar, MediaAreRefusedByTheFieldThatIsWrong) {
  const auto media = [](const std::string& list) {
    return mistake(with_stop(fmt::format(R"(, "media": [{}])", list)));
  };
  EXPECT_EQ(media(R"({"src": "a.jpg", "alt": "A door", "translations": {"de": {"alt": "Tür"}}},
                     {"src": "b.mp4", "captions": "b.vtt"}, {"src": "c.mp3"})"),
            "");
  EXPECT_THAT(media(R"({"alt": "x"})"), HasSubstr("media[0]: 'src' is missing"));
  EXPECT_THAT(media(R"({"src": "a.jpg"})"), HasSubstr("media[0]: 'alt' is missing"));
  EXPECT_THAT(media(R"({"src": "a.jpg", "alt": ""})"), HasSubstr("media[0].alt: is empty"));
  EXPECT_THAT(media(R"({"src": "a.svg", "alt": "x"})"),
              HasSubstr("media[0].src: has no extension"));
  EXPECT_THAT(media(R"({"src": "a.vtt"})"), HasSubstr("is a file of captions"));
  EXPECT_THAT(media(R"({"src": "a.mp4", "captions": "a.txt"})"), HasSubstr("no name of a .vtt"));
  EXPECT_THAT(media(R"({"src": "a.mp4", "captions": "../a.vtt"})"), HasSubstr("no name of a .vtt"));
  EXPECT_THAT(media(R"({"src": "a.mp4", "autoplay": true})"), HasSubstr("unknown field"));
  EXPECT_THAT(media(R"({"src": "a.mp4", "type": "image", "alt": "x"})"),
              HasSubstr("media[0].type"));
  for (const char* src : {"../a.jpg", "/a.jpg", "a/b.jpg", ".a.jpg", ""})
    EXPECT_THAT(media(fmt::format(R"({{"src": "{}", "alt": "x"}})", src)),
                HasSubstr("src: is no name of a file"));
  for (const char* src : {"http://media.example/a.jpg", "javascript:alert(1)", "data:image/png,x"})
    EXPECT_THAT(media(fmt::format(R"({{"src": "{}", "alt": "x"}})", src)),
                HasSubstr("src: is no https address"));
  for (const char* src : {"https://media.example.evil.example/a.jpg", "https://evil.example/a.jpg"})
    EXPECT_THAT(media(fmt::format(R"({{"src": "{}", "alt": "x"}})", src)),
                HasSubstr("src: is at no site"));
  const auto entries = [&](std::size_t count) {
    return media(
        fmt::format("{}", fmt::join(std::vector<std::string>(count, R"({"src": "a.mp3"})"), ",")));
  };
  EXPECT_EQ(entries(8), "");
  EXPECT_THAT(entries(9), HasSubstr("media: has 9 entries, at most 8"));
}

TEST(SentSidecar, ForeignMediaHaveAKind) {
  const auto at = [](const std::string& medium) {
    try {
      check_sent_sidecar(with_stop(fmt::format(R"(, "media": [{}])", medium)),
                         {"https://media.example"});
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(at(R"({"src": "https://media.example/a.mp4?x=1"})"), "");
  EXPECT_EQ(at(R"({"src": "https://media.example/film", "type": "video"})"), "");
  EXPECT_THAT(at(R"({"src": "https://media.example/film"})"), HasSubstr("give it a type"));
  EXPECT_THAT(at(R"({"src": "https://media.example/film", "type": "page"})"),
              HasSubstr("type: is"));
}

TEST(SentSidecar, NarrationAndSoundAreSounds) {
  EXPECT_EQ(mistake(with_stop(R"(, "narration": {"src": "a.mp3", "captions": "a.vtt"})")), "");
  EXPECT_THAT(mistake(with_stop(R"(, "narration": {"src": "a.mp4"})")),
              HasSubstr("narration.src: is no sound"));
  EXPECT_THAT(mistake(with_stop(R"(, "narration": {"src": "a.mp3", "volume": 1})")),
              HasSubstr("unknown field 'volume'"));
  const auto sound = [](const std::string& fields) {
    return mistake(fmt::format(R"({{"tours": [{{"stops": [], "sound": {}}}]}})", fields));
  };
  EXPECT_EQ(sound(R"({"src": "sea.ogg", "volume": 0.5})"), "");
  EXPECT_THAT(sound(R"({"src": "sea.jpg"})"), HasSubstr("tours[0].sound.src: is no sound"));
  EXPECT_THAT(sound(R"({"src": "sea.ogg", "volume": 2})"), HasSubstr("volume: is not in 0"));
}

TEST(SentSidecar, TranslationsAreRefusedByTheFieldThatIsWrong) {
  const auto translated = [](const std::string& translations) {
    return mistake(with_stop(fmt::format(R"(, "translations": {})", translations)));
  };
  EXPECT_EQ(translated(R"({"de": {"title": "Halle"}, "zh-Hans": {"caption": "x"}, "gsw": {}})"),
            "");
  EXPECT_THAT(translated("[]"), HasSubstr("tours[0].stops[0].translations: is not an object"));
  EXPECT_THAT(translated(R"({"de": "Halle"})"), HasSubstr("translations.de: is not an object"));
  EXPECT_THAT(translated(R"({"de": {"titel": ""}})"), HasSubstr("unknown field 'titel'"));
  EXPECT_THAT(translated(R"({"de": {"title": 1}})"), HasSubstr("translations.de.title"));
  for (const char* tag :
       {"", "d", "de_CH", "-de", "de-", "de--CH", "deutschland", "<b>", "\u0000d"})
    EXPECT_THAT(translated(fmt::format(R"({{"{}": {{}}}})", tag)), HasSubstr("is no language"));
  EXPECT_THAT(mistake(R"({"tours": [{"stops": [], "translations": {"de": {"caption": ""}}}]})"),
              HasSubstr("unknown field 'caption'"));
  const auto languages = [](int count) {
    std::vector<std::string> all;
    for (int i = 0; i < count; ++i) all.push_back(fmt::format(R"("x{}": {{}})", i));
    return fmt::format("{{{}}}", fmt::join(all, ","));
  };
  EXPECT_EQ(translated(languages(32)), "");
  EXPECT_THAT(translated(languages(33)), HasSubstr("has 33 languages, at most 32"));
}

}  // namespace
}  // namespace catgs::test
