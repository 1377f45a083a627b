#include "server/scene_id.h"

#include <set>

#include <gtest/gtest.h>

namespace catgs {
namespace {

TEST(SceneId, IsShortPrintableTextThatAPathKeeps) {
  for (const char* id : {"city", "a b", "Großmünster", "…", "...", ".hidden", "a/b?c#d%41"})
    EXPECT_TRUE(is_scene_id(id)) << id;
  for (const char* id :
       {"", ".", "..", "a\nb", "a\tb", "a\x1b[31mb", "a\x7f", "a\xc2\x9b", "caf\xe9"})
    EXPECT_FALSE(is_scene_id(id)) << id;
  EXPECT_TRUE(is_scene_id(std::string(128, 'x')));
  EXPECT_FALSE(is_scene_id(std::string(129, 'x')));
}

TEST(SceneId, EveryNameHasOneOfItsOwn) {
  std::set<std::string> ids;
  const auto id_of = [&](const std::string& name) {
    const std::string id =
        scene_id_of(name, [&](const std::string& other) { return ids.contains(other); });
    EXPECT_TRUE(is_scene_id(id)) << id;
    EXPECT_TRUE(ids.insert(id).second) << id;
    return id;
  };
  EXPECT_EQ(id_of("city"), "city");
  for (int n = 2; n < 20; ++n) EXPECT_EQ(id_of("city"), "city-" + std::to_string(n));
  EXPECT_EQ(id_of("a\x1b[31m"), "a\\x1b[31m");
  EXPECT_EQ(id_of("a\\x1b[31m"), "a\\x1b[31m-2");
  EXPECT_EQ(id_of("caf\xe9"), "caf\\xe9");
  EXPECT_EQ(id_of(""), "scene");
  EXPECT_EQ(id_of(".."), "scene-2");
  for (int i = 0; i < 100; ++i) id_of(std::string(255, '\n'));
  for (int i = 0; i < 100; ++i) id_of(std::string(99, 'x') + "ß");
}

TEST(SceneId, IsFoundQuicklyAmongThousandsThatBeginAlike) {
  const std::string name(120, 'x');
  std::set<std::string> ids;
  int looks = 0;
  const auto taken = [&](const std::string& id) {
    ++looks;
    return ids.contains(id);
  };
  for (int i = 0; i < 1000; ++i) ids.insert(scene_id_of(name, taken));
  EXPECT_EQ(ids.size(), 1000u);
  EXPECT_LT(looks, 1000 * 25);
}

}  // namespace
}  // namespace catgs
