#include "server/tours.h"

#include <nlohmann/json.hpp>

#include "render_core/scene/save_scene.h"
#include "tests/render_core/scene/encoders.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class Tours : public FolderTest {
 protected:
  void SetUp() override { save_scene(random_cloud(30, 0), folder_ / "museum.splat"); }
  nlohmann::json read() { return nlohmann::json::parse(read_tours(folder_ / "museum.splat")); }
};

TEST_F(Tours, AreEmptyWithoutFiles) {
  EXPECT_TRUE(read()["tours"].is_null());
  EXPECT_TRUE(read()["settings"].is_null());
}

TEST_F(Tours, ComeFromTheSidecarAndTheViewersSettings) {
  write("museum.json", R"({"up": "-y", "tours": [{"title": "Hall"}]})");
  write("settings.json", R"({"version": 2, "animTracks": [], "annotations": [{"title": "Door"}]})");
  EXPECT_EQ(read()["tours"][0]["title"], "Hall");
  EXPECT_EQ(read()["settings"]["annotations"][0]["title"], "Door");
  write("museum.settings.json", R"({"version": 2, "animTracks": [1]})");
  EXPECT_EQ(read()["settings"]["animTracks"].size(), 1u) << "the scene's own come first";
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
  EXPECT_THAT([&] { read_tours(folder_ / "museum.splat"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("byte 265: is nested deeper than 256")));
}

TEST_F(Tours, SayWhatIsWrongInASidecar) {
  write("museum.json", R"({"tours": {"title": "Hall"}})");
  EXPECT_THAT([&] { read_tours(folder_ / "museum.splat"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("tours: is not an array")));
}

}  // namespace
}  // namespace catgs::test
