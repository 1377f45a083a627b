#include "render_core/scene/formats/streamed_sog.h"

#include <algorithm>
#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/scene_size.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/json_refusals.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/descriptor_limit.h"

namespace catgs::test {
namespace {

using Json = nlohmann::json;

Json piece(int file, int offset, int count) {
  return {{"file", file}, {"offset", offset}, {"count", count}};
}

/// Three nodes; level 0 has 100 + 200 + 300, level 1 has 40 + 50 (the third node lacks it), level 2
/// 10 + 11 + 12 Gaussians.
class StreamedSogTest : public FolderTest {
 protected:
  void SetUp() override {
    write_sog("fine", 600, 2);
    write_sog("middle", 90, 1);
    write_sog("coarse", 33, 1);
    meta_ = {
        {"version", 1},
        {"lodLevels", 3},
        {"filenames", {"fine/meta.json", "middle/meta.json", "coarse/meta.json"}},
        {"tree",
         {{"children",
           {{{"lods", {{"0", piece(0, 0, 100)}, {"1", piece(1, 0, 40)}, {"2", piece(2, 0, 10)}}}},
            {{"children",
              {{{"lods",
                 {{"0", piece(0, 100, 200)}, {"1", piece(1, 40, 50)}, {"2", piece(2, 10, 11)}}}},
               {{"lods", {{"0", piece(0, 300, 300)}, {"2", piece(2, 21, 12)}}}}}}}}}}}};
  }

  GaussianCloud write_sog(const std::string& name, std::size_t count, int degree) {
    const GaussianCloud cloud = random_cloud(count, degree, static_cast<unsigned>(count));
    for (const auto& [file, content] : encode_sog(cloud, 2)) write(name + "/" + file, content);
    return cloud;
  }

  DecodedScene load(std::optional<int> level = {}, std::optional<std::size_t> budget = {}) {
    write("lod-meta.json", meta_.dump());
    const FolderFiles files(folder_.path());
    const OpenStreamedSog scene = open_streamed_sog(files, level, budget);
    return {scene.detail, read_streamed_sog(files, scene, two_threads())};
  }

  /// What an error names that lod-meta.json is refused with.
  Refusal at(const std::string& where) const {
    return {(folder_ / "lod-meta.json").string(), where};
  }

  Json meta_;
};

TEST_F(StreamedSogTest, ArchivesAreReadAsFoldersAre) {
  write("lod-meta.json", meta_.dump());
  std::map<std::string, std::string> files = files_below(folder_.path());
  const auto path = write("museum.ssog", zip(files));
  LoadOptions options;
  EXPECT_EQ(load_scene(path, options).cloud.mean, load().cloud.mean);
  options.lod = 2;
  EXPECT_EQ(read_scene_size(locate_scene(path), options).gaussians, 33u);
  const Scene scene = load_scene(path, options);
  EXPECT_EQ(scene.cloud.size(), 33u);
  EXPECT_EQ(scene.format, "streamed sog (level 2 of 0…2)");
  files["env/meta.json"] = "";
  for (const auto& [name, content] : encode_sog(random_cloud(7, 0), 2))
    files["env/" + name] = content;
  meta_["environment"] = "env/meta.json";
  files["lod-meta.json"] = meta_.dump();
  EXPECT_EQ(read_scene_size(locate_scene(write("museum.ssog", zip(files))), options).gaussians,
            40u);
}

TEST_F(StreamedSogTest, LevelsAreAssembledFromAllNodes) {
  EXPECT_EQ(load().cloud.size(), 600u);
  EXPECT_EQ(load(0).cloud.size(), 600u);
  EXPECT_EQ(load(1).cloud.size(), 40u + 50 + 12);  // the third node's next coarser one
  EXPECT_EQ(load(2).cloud.size(), 33u);
  EXPECT_EQ(load(0).format, "level 0 of 0…2");
  EXPECT_EQ(load(1).format, "levels 1 and 2 of 0…2");
  const GaussianCloud coarse = random_cloud(33, 1, 33);
  const GaussianCloud read = load(2).cloud;
  for (std::size_t i = 0; i < 33; ++i)
    EXPECT_LT(glm::distance(read.mean[i], coarse.mean[i]), 0.001f);
}

TEST_F(StreamedSogTest, MixedDegreesGiveTheHighest) {
  meta_["tree"]["children"][0]["lods"].erase("1");
  meta_["tree"]["children"][0]["lods"].erase("2");
  const GaussianCloud cloud = load(2).cloud;
  EXPECT_EQ(cloud.sh_degree, 2);
  EXPECT_EQ(cloud.size(), 100u + 11 + 12);
}

TEST_F(StreamedSogTest, TheBudgetBuysTheFinestLevelsThatFit) {
  EXPECT_EQ(load({}, 600).cloud.size(), 600u);
  EXPECT_EQ(load({}, 33).cloud.size(), 33u);
  EXPECT_EQ(load({}, 63).cloud.size(), 63u);  // the first node's level 1 costs 30 more
  EXPECT_EQ(load({}, 62).cloud.size(), 33u);
  EXPECT_EQ(load({}, 102).cloud.size(), 102u);
  EXPECT_EQ(load({}, 162).cloud.size(), 162u);  // and its level 0 another 60
  EXPECT_EQ(refusal_of([&] { load({}, 32); }), at("Gaussian budget"));
}

TEST_F(StreamedSogTest, TheEnvironmentComesWithEveryLevel) {
  write_sog("sky", 25, 1);
  meta_["environment"] = "sky/meta.json";
  EXPECT_EQ(load(2).cloud.size(), 58u);
  EXPECT_EQ(load({}, 62).cloud.size(), 58u);
  EXPECT_EQ(refusal_of([&] { load({}, 57); }), at("Gaussian budget"));
}

TEST_F(StreamedSogTest, BundledSogFilesAreRead) {
  const GaussianCloud cloud = random_cloud(600, 2, 600);
  write("fine.sog", zip(encode_sog(cloud, 2)));
  meta_["filenames"][0] = "fine.sog";
  EXPECT_LT(glm::distance(load(0).cloud.mean[599], cloud.mean[599]), 0.001f);
}

TEST_F(StreamedSogTest, ManyFilesAreNotOpenAtOnce) {
  meta_ = {{"version", 1}, {"lodLevels", 1}};
  for (int i = 0; i < 20; ++i) {
    const std::string name = "part" + std::to_string(i) + ".sog";
    write(name, zip(encode_sog(random_cloud(10, 0), 2)));
    meta_["filenames"].push_back(name);
    meta_["tree"]["children"].push_back({{"lods", {{"0", piece(i, 0, 10)}}}});
  }
  two_threads();  // before there is no room for what it opens
  const DescriptorLimit limit(next_descriptor() + 4);
  EXPECT_EQ(load().cloud.size(), 200u);
}

/// This process's memory.
std::size_t resident_bytes() {
  std::size_t size = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> size >> resident;
  return resident * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

TEST_F(StreamedSogTest, ArchivesAreUnpackedOneAtATime) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "AddressSanitizer keeps what was freed";
#endif
  constexpr int parts = 128;
  auto files = encode_sog(random_cloud(10, 0), 2);
  files["junk"] = std::string(1'000'000, '\0');  // deflated a thousand bytes
  const std::string archive = zip(files, true);
  meta_ = {{"version", 1}, {"lodLevels", 1}};
  for (int i = 0; i < parts; ++i) {
    const std::string name = std::to_string(i) + ".sog";
    write(name, archive);
    meta_["filenames"].push_back(name);
    meta_["tree"]["children"].push_back({{"lods", {{"0", piece(i, 0, 10)}}}});
  }
  const std::size_t before = resident_bytes();
  std::size_t most = 0;
  const auto look = [&](double) { most = std::max(most, resident_bytes()); };
  write("lod-meta.json", meta_.dump());
  ThreadPool pool(2);
  const FolderFiles scene(folder_.path());
  read_streamed_sog(scene, open_streamed_sog(scene, {}, {}), LoadContext(pool, look));
  ASSERT_GT(most, 0u);
  EXPECT_LT(most, before + parts * files["junk"].size() / 4);
}

TEST_F(StreamedSogTest, ErrorsNameTheField) {
  EXPECT_EQ(input_error([&] { load(3); }),
            (folder_ / "lod-meta.json").string() +
                ": level of detail: there is no level 3; 0 (finest) to 2 are");
  EXPECT_EQ(refusal_of([&] { load(-1); }), at("level of detail"));
  EXPECT_EQ(refusal_of([&] { load(1, 100); }), at(""));
  const auto read = [&](const Json& meta) {
    meta_ = meta;
    load();
  };
  const std::string first = "/tree/children/0/lods/0", folder = folder_.path().string();
  const std::string at_first = "tree.children[0].lods.0";
  expect_refused(Json(meta_), at("").source, read,
                 {
                     {"/version", 2, "version"},
                     {"/lodLevels", 0, "lodLevels"},
                     {"/lodLevels", 2, "tree.children[0].lods"},
                     {first + "/file", 3, at_first + ".file"},
                     {first + "/count", -1, at_first + ".count"},
                     {first + "/offset", 601, "tree"},
                     {first + "/count", 101, "tree"},
                     {"/tree", Json::object(), "tree"},
                     {"/filenames/0", "../x/meta.json", "file name '../x/meta.json'", folder},
                     {"/filenames/0", "absent/meta.json", "", folder + "/absent/meta.json"},
                 });
}

TEST_F(StreamedSogTest, PartsShareNoFile) {
  const auto refusal_with = [&](const std::string& other, const std::string& environment = "") {
    meta_ = {{"lodLevels", 1}, {"filenames", {"fine/meta.json", other}}};
    if (!environment.empty()) meta_["environment"] = environment;
    for (int file = 0; file < 2; ++file)
      meta_["tree"]["children"].push_back({{"lods", {{"0", piece(file, 0, 10)}}}});
    return refusal_of([&] { load(); });
  };
  EXPECT_EQ(refusal_with("./fine//meta.json"), at("file ./fine//meta.json"));
  EXPECT_EQ(refusal_with("middle/meta.json", "fine/meta.json"), at("file fine/meta.json"));
  const auto files = encode_sog(random_cloud(600, 2, 600), 2);
  write("fine/other.json", files.at("meta.json"));
  EXPECT_EQ(refusal_with("fine/other.json"), at("file fine/means_l.webp"));
  Json shared = Json::parse(files.at("meta.json"));
  for (const char* attribute : {"means", "scales", "quats", "sh0", "shN"})
    for (Json& name : shared[attribute]["files"]) name = "other_" + name.get<std::string>();
  shared["shN"]["files"][0] = "shN_centroids.webp";
  for (const auto& [name, content] : files) write("fine/other_" + name, content);
  write("fine/other.json", shared.dump());
  EXPECT_EQ(refusal_with("fine/other.json"), at("file fine/shN_centroids.webp"));
}

/// A picture of one colour is a few bytes, so SOGs of 65,536 Gaussians are small.
TEST_F(StreamedSogTest, ManySmallFilesMakeNoHugeScene) {
  auto files = encode_sog(random_cloud(1, 0), 1);
  Json sog = Json::parse(files.at("meta.json"));
  sog["means"]["shape"][0] = 65'536;
  files["meta.json"] = sog.dump();
  const std::string image = encode_webp(std::string(4 * 65'536, '\0'), 256, 256);
  for (auto& [name, content] : files)
    if (name != "meta.json") content = image;
  meta_ = {{"lodLevels", 1}};
  const auto add_part = [&](int i) {
    const std::string name = std::to_string(i);
    for (const auto& [file, content] : files) write(name + "/" + file, content);
    meta_["filenames"].push_back(name + "/meta.json");
    meta_["tree"]["children"].push_back({{"lods", {{"0", piece(i, 0, 65'536)}}}});
  };
  add_part(0);
  EXPECT_EQ(load().cloud.size(), 65'536u);
  add_part(1);
  EXPECT_EQ(refusal_of([&] { load(); }), at("tree"));
}

TEST_F(StreamedSogTest, EndlessNestingIsRefused) {
  const auto read = [](int depth) {
    std::string text = R"({"lodLevels": 1, "filenames": [], "tree": )";
    for (int i = 0; i < depth; ++i) text += R"({"children":[)";
    text += "{}";
    for (int i = 0; i < depth; ++i) text += "]}";
    const std::string document = text + "}";
    return read_lod_tree(MemorySource("lod-meta.json", bytes_of(document)));
  };
  EXPECT_NO_THROW(read(64));
  EXPECT_THAT(refusal_of([&] { read(65); }).where,
              ::testing::MatchesRegex(R"(tree(\.children\[0\])+)"));
  EXPECT_EQ(refusal_of([&] { read(200'000); }), (Refusal{"lod-meta.json", ""}));
}

TEST_F(StreamedSogTest, TooManyFilesOrTooLongNamesAreRefused) {
  const auto read = [](std::size_t files, std::size_t name_bytes) {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < files; ++i) names.push_back(std::to_string(i));
    names[0].resize(name_bytes, 'x');
    const std::string document =
        Json{{"lodLevels", 1}, {"filenames", names}, {"tree", Json::object()}}.dump();
    return read_lod_tree(MemorySource("lod-meta.json", bytes_of(document))).files.size();
  };
  EXPECT_EQ(read(65'536, 4096), 65'536u);
  EXPECT_EQ(refusal_of([&] { read(65'537, 1); }), (Refusal{"lod-meta.json", "filenames"}));
  EXPECT_EQ(refusal_of([&] { read(1, 4097); }), (Refusal{"lod-meta.json", "filenames[0]"}));
}

TEST_F(StreamedSogTest, TooManyNodesOrLevelsAreRefused) {
  const auto read = [](std::size_t nodes, int levels) {
    const std::vector<std::string> all(nodes, R"({"lods":{}})");
    const std::string document =
        fmt::format(R"({{"lodLevels": {}, "filenames": [], "tree": {{"children": [{}]}}}})", levels,
                    fmt::join(all, ","));
    return read_lod_tree(MemorySource("lod-meta.json", bytes_of(document))).nodes.size();
  };
  EXPECT_EQ(read(65'536, 16), 65'536u);
  EXPECT_EQ(refusal_of([&] { read(65'537, 1); }),
            (Refusal{"lod-meta.json", "tree.children[65536].lods"}));
  EXPECT_EQ(refusal_of([&] { read(1, 17); }), (Refusal{"lod-meta.json", "lodLevels"}));
}

}  // namespace
}  // namespace catgs::test
