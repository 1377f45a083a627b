#include "server/base/scene_id.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr std::array<unsigned char, 4> digest = {0x00, 0x12, 0x9a, 0xff};

TEST(SceneId, IsShortPrintableTextThatAPathKeeps) {
  for (const char* id : {"city", "a b", "Großmünster", "…", "...", ".hidden", "a/b?c#d%41"})
    EXPECT_TRUE(is_scene_id(id)) << id;
  for (const char* id :
       {"", ".", "..", "a\nb", "a\tb", "a\x1b[31mb", "a\x7f", "a\xc2\x9b", "caf\xe9"})
    EXPECT_FALSE(is_scene_id(id)) << id;
  EXPECT_TRUE(is_scene_id(std::string(128, 'x')));
  EXPECT_FALSE(is_scene_id(std::string(129, 'x')));
}

TEST(SceneId, IsANameAndADigest) {
  EXPECT_EQ(scene_id_of("hall", digest), "hall-bbcdnpvv");
  EXPECT_EQ(scene_name_of("a\x1b[31m"), "a\\x1b[31m");
  EXPECT_EQ(scene_name_of("caf\xe9"), "caf\\xe9");
  EXPECT_EQ(scene_name_of(""), "scene");
  EXPECT_EQ(scene_name_of(".."), "scene");
  for (const std::string& name :
       {std::string("hall"), std::string(".."), std::string(255, '\n'), std::string(99, 'x') + "ß",
        std::string("hall-2"), std::string("hall-bbcdnpvv"), std::string("a\x1b[31m")}) {
    const std::string id = scene_id_of(name, digest);
    EXPECT_TRUE(is_scene_id(id)) << id;
    EXPECT_TRUE(belongs_to_path(id)) << id;
    EXPECT_EQ(name_in(id), scene_name_of(name));
  }
}

TEST(SceneId, NamesOfFilesAreNoDigests) {
  for (const char* name : {"hall", "hall-2", "scan-20240131", "hall-building", "hall-deadbeef",
                           "bbcdnpvv", "-bbcdnpvv", "hall-bbcdnpv", "hall-BBCDNPVV", ""}) {
    EXPECT_FALSE(belongs_to_path(name)) << name;
    EXPECT_EQ(name_in(name), name);
  }
}

}  // namespace
}  // namespace catgs
