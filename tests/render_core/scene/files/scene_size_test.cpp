#include "render_core/scene/files/scene_size.h"

#include <string>

#include <fmt/format.h>

#include "render_core/scene/files/save_scene.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/render_core/scene/tree/tree_test_support.h"

namespace catgs::test {
namespace {

class SceneSizeTest : public FolderTest {
 protected:
  /// The headers announce what is loaded, and its memory.
  void expect_as_loaded(const std::string& name, const std::string& content) {
    const auto path = write(name, content);
    const SceneSize size = read_scene_size(locate_scene(path));
    const Scene scene = load_scene(path);
    EXPECT_EQ(size.gaussians, scene.report.read) << name;
    EXPECT_EQ(size.sh_degree, scene.cloud.sh_degree) << name;
    EXPECT_GE(size.bytes(), scene.cloud.bytes()) << name;
  }
};

TEST_F(SceneSizeTest, SizesAreThoseOfTheLoadedScene) {
  ThreadPool pool(1);
  for (const int degree : {0, 3}) {
    const GaussianCloud cloud = random_cloud(300, degree);
    expect_as_loaded("a.ply", ply_bytes(cloud));
    expect_as_loaded("b.ply", encode_compressed_ply(cloud, true));
    for (const int version : {1, 2, 3, 4})
      expect_as_loaded("c.spz", encode_spz(cloud, {.version = version}));
    expect_as_loaded("g.tree", tree_bytes(cloud, pool));
    expect_as_loaded("d.sog", zip(encode_sog(cloud, 2), true));
  }
  expect_as_loaded("e.splat", std::string(32 * 7, '\x40'));
  expect_as_loaded("f.spz", encode_spz(random_cloud(300, 3), {.extra_sh_degree = 4}));
}

TEST_F(SceneSizeTest, HighestDegreeIsAssumedIfOnlyImagesTell) {
  const SceneSize size =
      read_scene_size(locate_scene(write("v1.sog", zip(encode_sog(random_cloud(90, 1), 1)))));
  EXPECT_EQ(size.gaussians, 90u);
  EXPECT_EQ(size.sh_degree, 3);
}

TEST_F(SceneSizeTest, FoldersHaveSizesToo) {
  for (const auto& [name, content] : encode_sog(random_cloud(80, 2), 2))
    write("house/" + name, content);
  EXPECT_EQ(read_scene_size(locate_scene(folder_ / "house")).gaussians, 80u);
  EXPECT_EQ(read_scene_size(locate_scene(folder_ / "house")).sh_degree, 2);
}

TEST_F(SceneSizeTest, OnlyHeadersAreRead) {
  // The rows are a hole in the file: nothing of it could be decoded in this time or memory.
  std::string header = ply_bytes(random_cloud(1, 3));
  header.resize(header.find("end_header\n") + 11);
  header.replace(header.find("vertex 1\n"), 9, "vertex 60000000\n");
  const auto path = write("huge.ply", header);
  std::filesystem::resize_file(path, header.size() + 60'000'000ull * 62 * 4);
  const SceneSize size = read_scene_size(locate_scene(path));
  EXPECT_EQ(size.gaussians, 60'000'000u);
  EXPECT_EQ(size.bytes(), GaussianCloud::bytes(60'000'000, 3));
}

TEST_F(SceneSizeTest, ACountThatTheFileCannotHoldIsAnError) {
  std::string lying = ply_bytes(random_cloud(10, 0));
  lying.replace(lying.find("vertex 10"), 9, "vertex 99");
  const std::string path = write("a.ply", lying).string();
  EXPECT_EQ(refusal_of([&] { read_scene_size(locate_scene(path)); }),
            (Refusal{path, fmt::format("byte {}", lying.size())}));
  EXPECT_THROW(read_scene_size(locate_scene(write("b.txt", "hello"))), InputError);
  EXPECT_THROW(read_scene_size(locate_scene(folder_ / "absent.ply")), InputError);
}

}  // namespace
}  // namespace catgs::test
