#include "server/scenes/tours.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/files/save_scene.h"
#include "server/net/http.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/captured_log.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

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

TEST_F(Tours, ComeFromTheGivenTextAndNotFromTheDisk) {
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
  EXPECT_THAT([&] { read(); },
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
  EXPECT_EQ(refused_field([&] { read(); }), "tours");
}

TEST_F(Tours, MeasuresAreServedWithAndWithoutTours) {
  write("museum.json", R"({"measures": [{"marks": []}]})");
  const CapturedLog log;
  const auto read_back = read();
  EXPECT_EQ(read_back["measures"].size(), 1u);
  EXPECT_TRUE(read_back["tours"].is_null());
  EXPECT_THAT(log.text(), HasSubstr("museum.json: measures[0].marks: has 0 entries"));
}

TEST_F(Tours, AreServedAndLoggedDespiteAMistake) {
  const CapturedLog log;
  const auto show = [&](const std::string& stop) {
    write("museum.json", fmt::format(R"({{"tours": [{{"stops": [{}]}}]}})", stop));
    return read()["tours"][0]["stops"].size();
  };
  EXPECT_EQ(show(R"({"position": [0, 0, 0], "look_at": [0, 0, 1]})"), 1u);
  EXPECT_EQ(log.text(), "");
  EXPECT_EQ(show(R"({"position": [0, 0, 0], "look_at": [0, 0, 1], "titel": "Door"})"), 1u);
  EXPECT_THAT(log.text(), AllOf(HasSubstr("museum.json: tours[0].stops[0]: unknown field 'titel'"),
                                HasSubstr("known are title")));
  show(R"({"position": [0, 0, 0], "look_at": [0, 0, 1],
           "media": [{"src": "https://media.example/a.mp4"}]})");
  EXPECT_THAT(log.text(), HasSubstr("--media-origin"));
}

constexpr std::string_view stop = R"({"position": [0, 1, 2], "look_at": [0, 1, 3])";

std::string with_stop(const std::string& more) {
  return fmt::format(R"({{"tours": [{{"title": "Hall", "stops": [{}{}}}]}}]}})", stop, more);
}

TEST(SentSidecar, AWholeTourIsTaken) {
  const Sidecar sidecar = check_sent_sidecar(
      R"({"up": "-y", "near": 0.1, "tours": [{"title": "Hall", "autoplay": true, "stops": [
          {"title": "Door", "caption": "Oak.", "position": [1, 2, 3], "orientation": [0, 0, 0, 1],
           "fov_deg": 60, "view_height": 4, "section": [1, 2, 3, 4, 5, 6, -30],
           "marker": [1, 2, 4], "stay_s": 8, "fly_s": 2}]}]})");
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

/// The field of the sidecar that is refused; empty if it is taken.
std::string mistake(const std::string& json) {
  return refused_field([&] { check_sent_sidecar(json, {"https://media.example"}); });
}

/// What stands behind the fields of the stop, and the field below it that is refused.
struct InStop {
  std::string more, field;
};
void expect_in_stop(std::initializer_list<InStop> cases) {
  for (const auto& [more, field] : cases)
    EXPECT_EQ(mistake(with_stop(", " + more)), "tours[0].stops[0]" + field) << more;
}

std::string repeated(std::size_t count, const std::string& text) {
  return fmt::format("{}", fmt::join(std::vector<std::string>(count, text), ","));
}

TEST(SentSidecar, PortalsAreRefusedByTheFieldThatIsWrong) {
  expect_in_stop({
      {R"("portal": 7)", ".portal"},
      {R"("portal": {})", ".portal"},
      {R"("portal": {"scene": ""})", ".portal.scene"},
      {fmt::format(R"("portal": {{"scene": "{}"}})", std::string(129, 'a')), ".portal.scene"},
      {R"("portal": {"scene": "hall", "where": 1})", ".portal"},
      {R"("portal": {"scene": "hall", "stop": 0})", ".portal.stop"},
      {R"("portal": {"scene": "hall", "stop": 257})", ".portal.stop"},
      {R"("portal": {"scene": "hall", "tour": 1.5})", ".portal.tour"},
      {R"("portal": {"scene": "hall", "position": [0, 0, 0]})", ".portal"},
      {R"("portal": {"scene": "hall", "stop": 1, "position": [0, 0, 0], "look_at": [0, 0, 1]})",
       ".portal"},
      {R"("portal": {"scene": "hall", "tour": 1, "position": [0, 0, 0], "look_at": [0, 0, 1]})",
       ".portal"},
  });
  for (const char* part : {R"("look_at": [0, 0, 1])", R"("orientation": [0, 0, 0, 1])",
                           R"("fov_deg": 50)", R"("look_at": "nowhere")"})
    expect_in_stop({{fmt::format(R"("portal": {{"scene": "hall", {}}})", part), ".portal"}});
}

TEST(SentSidecar, IsRefusedByTheFieldThatIsWrong) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"[]", "sidecar"},
      {R"({"near": -1})", "near"},
      {R"({"start_pose":{"position":[3e38,3e38,3e38],"look_at":[0,0,0]}})", "start_pose.position"},
      {R"({"poster": 1})", "sidecar"},
      {R"({"tours": {}})", "tours"},
      {R"({"tours": [1]})", "tours[0]"},
      {R"({"tours": [{"title": "Hall"}]})", "tours[0]"},
      {R"({"tours": [{"stops": [], "autoplay": 1}]})", "tours[0].autoplay"},
      {R"({"tours": [{"stops": [{"position": [0, 0, 0]}]}]})", "tours[0].stops[0]"},
      {R"({"tours": [{"stops": [{"position": [0, 0, 0], "orientation": [0, 0, 0, 0]}]}]})",
       "tours[0].stops[0].orientation"},
      {R"({"tours": [{"stops": [{"position": [0, 0, 0], "orientation": [0, 0, 0.995, 0]}]}]})",
       ""}};
  for (const auto& [json, field] : cases) EXPECT_EQ(mistake(json), field) << json;
  EXPECT_THAT(mistake("{ broken"), StartsWith("byte "));
  expect_in_stop({{R"("fov_deg": 400)", ".fov_deg"},
                  {R"("stay_s": -1)", ".stay_s"},
                  {R"("fly_s": 121)", ".fly_s"},
                  {R"("view_height": 0)", ".view_height"},
                  {R"("section": [1, 2, 3, 4, 5, 6])", ".section"},
                  {R"("section": [1, 2, 3, 4, 0, 6, 0])", ".section[4]"},
                  {R"("marker": [0, 0])", ".marker"},
                  {R"("captoin": "x")", ""},
                  {R"("caption": 7)", ".caption"}});
}

TEST(SentSidecar, HasALargestSizeInEachRespect) {
  const auto caption = [](std::size_t bytes) {
    return with_stop(fmt::format(R"(, "caption": "{}")", std::string(bytes, 'x')));
  };
  EXPECT_EQ(mistake(caption(16'000)), "");
  EXPECT_EQ(mistake(caption(16'001)), "tours[0].stops[0].caption");
  const auto tours = [](std::size_t count) {
    return fmt::format(R"({{"tours": [{}]}})", repeated(count, R"({"stops": []})"));
  };
  EXPECT_EQ(mistake(tours(32)), "");
  EXPECT_EQ(mistake(tours(33)), "tours");
  const auto stops = [](std::size_t count) {
    return fmt::format(R"({{"tours": [{{"stops": [{}]}}]}})",
                       repeated(count, std::string(stop) + "}"));
  };
  EXPECT_EQ(mistake(stops(256)), "");
  EXPECT_EQ(mistake(stops(257)), "tours[0].stops");
  const auto media = [](std::size_t count) {
    return with_stop(fmt::format(R"(, "media": [{}])", repeated(count, R"({"src": "a.mp3"})")));
  };
  EXPECT_EQ(mistake(media(8)), "");
  EXPECT_EQ(mistake(media(9)), "tours[0].stops[0].media");
  const auto languages = [](int count) {
    std::vector<std::string> all;
    for (int i = 0; i < count; ++i) all.push_back(fmt::format(R"("x{}": {{}})", i));
    return with_stop(fmt::format(R"(, "translations": {{{}}})", fmt::join(all, ",")));
  };
  EXPECT_EQ(mistake(languages(32)), "");
  EXPECT_EQ(mistake(languages(33)), "tours[0].stops[0].translations");
  EXPECT_EQ(mistake(std::string((1 << 20) - 2, ' ') + "{}"), "");
  EXPECT_NE(mistake(std::string((1 << 20) - 1, ' ') + "{}"), "");
}

TEST(SentSidecar, MeasuresAreTakenOrRefusedByTheFieldThatIsWrong) {
  const auto measures = [](std::size_t count, const std::string& measure) {
    return fmt::format(R"({{"measures": [{}]}})", repeated(count, measure));
  };
  const auto marks = [](std::size_t count, const std::string& mark) {
    return fmt::format(R"({{"title": "Door", "marks": [{}]}})", repeated(count, mark));
  };
  const std::string good = R"({"position": [1, 2, 3], "error": 0.02, "depth": [0, 0, 1]})",
                    bad = "measures[0].marks";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {measures(64, marks(2, good)), ""},
      {measures(65, marks(2, good)), "measures"},
      {measures(1, marks(100, good)), ""},
      {measures(1, marks(101, good)), bad},
      {measures(1, marks(1, good)), bad},
      {measures(1, "{}"), "measures[0]"},
      {R"({"measures": {}})", "measures"},
      {measures(1, R"({"titel": "x", "marks": []})"), "measures[0]"},
      {measures(1, R"({"title": 7, "marks": []})"), "measures[0].title"},
      {measures(1, marks(2, R"({"position": [1, 2]})")), bad + "[0].position"},
      {measures(1, marks(2, R"({"position": [1, 2, 3], "error": -1})")), bad + "[0].error"},
      {measures(1, marks(2, R"({"position": [1, 2, 3], "depth": 1})")), bad + "[0].depth"},
      {measures(1, marks(2, R"({"at": [1, 2, 3]})")), bad + "[0]"}};
  for (const auto& [json, field] : cases) EXPECT_EQ(mistake(json), field) << json;
}

TEST(SentSidecar, MediaAreRefusedByTheFieldThatIsWrong) {
  const auto media = [](const std::string& list) {
    return mistake(with_stop(fmt::format(R"(, "media": [{}])", list)));
  };
  for (const char* good :
       {R"({"src": "a.jpg", "alt": "A door", "translations": {"de": {"alt": "Tür"}}},
           {"src": "b.mp4", "captions": "b.vtt"}, {"src": "c.mp3"})",
        R"({"src": "https://media.example/a.mp4?x=1"})",
        R"({"src": "https://media.example/film", "type": "video"})"})
    EXPECT_EQ(media(good), "") << good;
  const std::vector<std::pair<std::string, std::string>> cases = {
      {R"({"alt": "x"})", ""},
      {R"({"src": "a.jpg"})", ""},
      {R"({"src": "a.jpg", "alt": ""})", ".alt"},
      {R"({"src": "a.svg", "alt": "x"})", ".src"},
      {R"({"src": "a.vtt"})", ".src"},
      {R"({"src": "a.mp4", "captions": "a.txt"})", ".captions"},
      {R"({"src": "a.mp4", "captions": "../a.vtt"})", ".captions"},
      {R"({"src": "a.mp4", "autoplay": true})", ""},
      {R"({"src": "a.mp4", "type": "image", "alt": "x"})", ".type"},
      {R"({"src": "https://media.example/film"})", ".src"},
      {R"({"src": "https://media.example/film", "type": "page"})", ".type"}};
  for (const auto& [medium, field] : cases)
    EXPECT_EQ(media(medium), "tours[0].stops[0].media[0]" + field) << medium;
  for (const char* src : {"../a.jpg", "/a.jpg", "a/b.jpg", ".a.jpg", "",
                          "http://media.example/a.jpg", "javascript:alert(1)", "data:image/png,x",
                          "https://media.example.evil.example/a.jpg", "https://evil.example/a.jpg"})
    EXPECT_EQ(media(fmt::format(R"({{"src": "{}", "alt": "x"}})", src)),
              "tours[0].stops[0].media[0].src")
        << src;
}

TEST(SentSidecar, NarrationAndSoundAreSounds) {
  EXPECT_EQ(mistake(with_stop(R"(, "narration": {"src": "a.mp3", "captions": "a.vtt"})")), "");
  expect_in_stop({{R"("narration": {"src": "a.mp4"})", ".narration.src"},
                  {R"("narration": {"src": "a.mp3", "volume": 1})", ".narration"}});
  const auto sound = [](const std::string& fields) {
    return mistake(fmt::format(R"({{"tours": [{{"stops": [], "sound": {}}}]}})", fields));
  };
  EXPECT_EQ(sound(R"({"src": "sea.ogg", "volume": 0.5})"), "");
  EXPECT_EQ(sound(R"({"src": "sea.jpg"})"), "tours[0].sound.src");
  EXPECT_EQ(sound(R"({"src": "sea.ogg", "volume": 2})"), "tours[0].sound.volume");
}

TEST(SentSidecar, TranslationsAreRefusedByTheFieldThatIsWrong) {
  EXPECT_EQ(mistake(with_stop(R"(, "translations":
      {"de": {"title": "Halle"}, "zh-Hans": {"caption": "x"}, "gsw": {}})")),
            "");
  expect_in_stop({{R"("translations": [])", ".translations"},
                  {R"("translations": {"de": "Halle"})", ".translations.de"},
                  {R"("translations": {"de": {"titel": ""}})", ".translations.de"},
                  {R"("translations": {"de": {"title": 1}})", ".translations.de.title"}});
  for (const char* tag :
       {"", "d", "de_CH", "-de", "de-", "de--CH", "deutschland", "<b>", "\u0000d"})
    expect_in_stop({{fmt::format(R"("translations": {{"{}": {{}}}})", tag), ".translations"}});
  EXPECT_EQ(mistake(R"({"tours": [{"stops": [], "translations": {"de": {"caption": ""}}}]})"),
            "tours[0].translations.de");
}

}  // namespace
}  // namespace catgs::test
