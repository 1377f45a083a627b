#include "render_core/scene/formats/sog.h"

#include <atomic>
#include <memory>

#include <nlohmann/json.hpp>

#include "render_core/scene/formats/sog_image.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/json_refusals.h"

namespace catgs::test {
namespace {

using Files = std::map<std::string, std::string>;

SogFile parse(const std::string& archive) {
  return read_sog(ZipFiles(MemorySource("scene.sog", bytes_of(archive))), "meta.json",
                  two_threads());
}

Refusal refusal(const Files& files, bool deflated = false) {
  return refusal_of([&] { parse(zip(files, deflated)); });
}

Files with_meta(Files files, const std::function<void(nlohmann::json&)>& change) {
  auto meta = nlohmann::json::parse(files.at("meta.json"));
  change(meta);
  files["meta.json"] = meta.dump();
  return files;
}

/// Steps of 1/65535 of the logarithmic means and of 1/255 of everything else, over the ranges of
/// random_cloud: means ±13, log scales -4 ± 5, SH ±1.5 and ±1.2.
Tolerance steps(int version) {
  return {.mean = 0.0006f,
          .log_scale = 0.0196f,
          .rotation_rad = smallest_three_angle(0.5f * 1.41422f / 255),
          .opacity = version == 1 ? 0.0046f : 0.00197f,
          .sh0 = 0.0060f,
          .sh1 = 0.0048f,
          .sh_rest = 0.0048f};
}

TEST(Sog, VersionsAreReadFromArchives) {
  for (const int version : {1, 2})
    for (const int degree : {0, 1, 2, 3})
      for (const bool deflated : {false, true}) {
        SCOPED_TRACE(testing::Message() << "version " << version << ", degree " << degree);
        const GaussianCloud cloud = random_cloud(5001, degree);
        const SogFile sog = parse(zip(encode_sog(cloud, version), deflated));
        EXPECT_EQ(sog.version, version);
        expect_near(cloud, sog.cloud, steps(version));
      }
}

TEST(Sog, MetaDataTellsTheModel) {
  const Files files = encode_sog(random_cloud(100, 0), 2);
  const auto model_with = [&](const nlohmann::json& model) {
    return parse(zip(with_meta(files, [&](nlohmann::json& meta) { meta["model"] = model; })))
        .cloud.model;
  };
  EXPECT_EQ(parse(zip(files)).cloud.model, SplatModel::standard);
  EXPECT_EQ(model_with("default"), SplatModel::standard);
  EXPECT_EQ(model_with("antialiased"), SplatModel::antialiased);
  EXPECT_EQ(model_with("2dgs"), SplatModel::surfels);
  EXPECT_EQ(model_with("Mip"), SplatModel::antialiased);
  EXPECT_EQ(model_with("tomorrow"), SplatModel::standard);
  const auto notes_with = [&](const char* key, const nlohmann::json& value) {
    return parse(zip(with_meta(files, [&](nlohmann::json& meta) { meta[key] = value; }))).notes;
  };
  EXPECT_TRUE(notes_with("model", "antialiased").empty());
  EXPECT_THAT(notes_with("model", "tomorrow"),
              testing::ElementsAre(testing::HasSubstr("tomorrow")));
  EXPECT_EQ(notes_with("antialiasing", "of a kind").size(), 1u);
  EXPECT_EQ(notes_with("asset", {{"antialiased", 3}}).size(), 1u);
  EXPECT_EQ(refusal_of([&] { model_with(7); }), (Refusal{"scene.sog/meta.json", "model"}));
}

class SogFolder : public FolderTest {};

TEST_F(SogFolder, FilesAreFoundBesideTheMetaData) {
  const GaussianCloud cloud = random_cloud(100, 1);
  for (const auto& [name, content] : encode_sog(cloud, 2)) write("part/" + name, content);
  const SogFile sog = read_sog(FolderFiles(folder_.path()), "part/meta.json", two_threads());
  expect_near(cloud, sog.cloud, steps(2));
}

TEST_F(SogFolder, NamesCannotLeadOut) {
  const Files files = encode_sog(random_cloud(100, 0), 2);
  for (const auto& [name, content] : files) write(name, content);
  const auto refusal_with = [&](const std::string& quats) {
    const auto name_it = [&](nlohmann::json& meta) { meta["quats"]["files"][0] = quats; };
    write("meta.json", with_meta(files, name_it).at("meta.json"));
    return refusal_of([&] { read_sog(FolderFiles(folder_.path()), "meta.json", two_threads()); });
  };
  EXPECT_EQ(refusal_with("../quats.webp"),
            (Refusal{folder_.path().string(), "file name '../quats.webp'"}));
  EXPECT_EQ(refusal_with(std::string("quats.webp\0001", 12)),
            (Refusal{folder_.path().string(), "file name 'quats.webp\\x001'"}));
}

TEST(Sog, RangesAreDecodedToTheirPlaces) {
  const GaussianCloud cloud = random_cloud(1000, 1);
  const std::string archive = zip(encode_sog(cloud, 2));
  const MemorySource source("scene.sog", bytes_of(archive));
  const ZipFiles files(source);
  const SogMeta meta = read_sog_meta(files, "meta.json");
  GaussianCloud read;
  read.resize(30, 2);  // degree 2: the SOG's coefficients of degree 1 go before zeros
  const std::array ranges = {SogRange{500, 10, 20}, SogRange{0, 20, 0}};
  decode_sog(files, meta, ranges, read, two_threads());
  for (std::size_t i = 0; i < 30; ++i) {
    const std::size_t from = i < 20 ? i : 480 + i;
    EXPECT_LT(glm::distance(read.mean[i], cloud.mean[from]), 0.001f);
    EXPECT_LT(glm::distance(read.sh_of(i)[3], cloud.sh_of(from)[3]), 0.01f);
    EXPECT_EQ(read.sh_of(i)[4], glm::vec3(0.0f));
  }
}

TEST(Sog, ImagesMayBePng) {
  const GaussianCloud cloud = random_cloud(500, 1);
  const Files webp = encode_sog(cloud, 2);
  const GaussianCloud wanted = parse(zip(webp)).cloud;
  for (const bool alpha : {true, false}) {  // what has no alpha has 255 there
    Files files;
    for (const auto& [name, content] : webp) {
      if (!name.ends_with(".webp")) continue;
      const SogImage image = read_sog_image(MemorySource(name, bytes_of(content)));
      const std::string rgba(image.rgba.begin(), image.rgba.end());
      bool opaque = true;
      for (std::size_t i = 3; i < rgba.size(); i += 4) opaque &= rgba[i] == '\xff';
      files[name.substr(0, name.size() - 4) + "png"] = encode_png(
          rgba, static_cast<int>(image.width), static_cast<int>(image.height), alpha || !opaque);
    }
    std::string& meta = files["meta.json"] = webp.at("meta.json");
    for (std::size_t at; (at = meta.find(".webp")) != std::string::npos;)
      meta.replace(at, 5, ".png");
    const GaussianCloud read = parse(zip(files)).cloud;
    EXPECT_EQ(read.mean, wanted.mean);
    EXPECT_EQ(read.rotation, wanted.rotation);
    EXPECT_EQ(read.scale, wanted.scale);
    EXPECT_EQ(read.opacity, wanted.opacity);
    EXPECT_EQ(read.sh, wanted.sh);
  }
}

TEST(Sog, DamagedPngIsRefused) {
  const std::string png = encode_png(std::string(4 * 64 * 64, '\x37'), 64, 64);
  const auto where = [](const std::string& bytes) {
    return refusal_of([&] { read_sog_image(MemorySource("a.png", bytes_of(bytes))); }).where;
  };
  for (std::size_t length = 0; length < png.size() - 16;
       ++length)  // its last chunks are not needed
    EXPECT_EQ(where(png.substr(0, length)), length < 26 ? "byte 0" : "") << length;
  const auto with = [&](std::size_t at, const std::string& bytes) {
    return where(std::string(png).replace(at, bytes.size(), bytes));
  };
  EXPECT_EQ(with(16, "\x7f"), "byte 16");                  // 2^31 wide
  EXPECT_EQ(with(24, "\x10"), "byte 24");                  // 16 bits
  EXPECT_EQ(with(25, std::string("\x03", 1)), "byte 24");  // a palette
  EXPECT_EQ(with(60, "\x01\x02\x03"), "");
}

TEST(Sog, AMissingFirstCodebookValueIsContinued) {
  const GaussianCloud cloud = random_cloud(500, 1);
  const Files files = with_meta(encode_sog(cloud, 2), [](nlohmann::json& meta) {
    for (const char* attribute : {"scales", "sh0", "shN"}) meta[attribute]["codebook"][0] = nullptr;
  });
  expect_near(cloud, parse(zip(files)).cloud, steps(2));
}

TEST(Sog, ErrorsNameTheField) {
  Files files = encode_sog(random_cloud(300, 1), 2);
  const auto sound = nlohmann::json::parse(files.at("meta.json"));
  const auto read = [&](const nlohmann::json& meta) {
    files["meta.json"] = meta.dump();
    parse(zip(files));
  };
  expect_refused(sound, "scene.sog/meta.json", read,
                 {
                     {"/version", 3, "version"},
                     {"/count", removed, ""},
                     {"/count", -4, "count"},
                     {"/means/mins", {1, 2}, "means.mins"},
                     {"/means/maxs/1", "a", "means.maxs[1]"},
                     {"/scales/codebook/3", removed, "scales.codebook"},
                     {"/sh0/files", nlohmann::json::array(), "sh0.files"},
                     {"/shN/bands", 4, "shN.bands"},
                     {"/shN/bands", 2, "size", "scene.sog/shN_centroids.webp"},
                     {"/quats/files/0", "nowhere.webp", "entry nowhere.webp", "scene.sog"},
                 });
}

TEST(Sog, LyingSizesAreRefusedBeforeMemoryIsTaken) {
  Files files = encode_sog(random_cloud(300, 0), 2);
  for (const std::uint64_t count :
       {std::uint64_t{0}, std::uint64_t{1000}, std::uint64_t{200'000'000}, ~std::uint64_t{0}})
    refusal(with_meta(files, [&](nlohmann::json& meta) { meta["count"] = count; }));
  // A picture of one colour is a few bytes however large it is.
  const std::string bomb = encode_webp(std::string(4 * 4096 * 2048, '\0'), 4096, 2048);
  for (auto& [name, content] : files)
    if (name != "meta.json") content = bomb;
  EXPECT_EQ(refusal(files), (Refusal{"scene.sog/means_l.webp", "size"}));
  EXPECT_EQ(refusal(with_meta(files, [](nlohmann::json& m) { m["count"] = 8'000'000; })),
            (Refusal{"scene.sog/meta.json", "count"}));
}

/// A WebP file with a chunk at its end that nobody reads.
std::string padded(std::string webp, std::uint32_t bytes) {
  webp += "JUNK";
  append(webp, bytes);
  webp.append(bytes, '\0');
  const auto riff_bytes = static_cast<std::uint32_t>(webp.size() - 8);
  return webp.replace(4, 4, reinterpret_cast<const char*>(&riff_bytes), 4);
}

TEST_F(SogFolder, NeitherZerosNorManyNamesOfOneFileMakeAHugeScene) {
  constexpr std::size_t count = 2'000'000;
  const std::string one_colour = encode_webp(std::string(4 * 2048 * 1024, '\0'), 2048, 1024);
  Files files = with_meta(encode_sog(random_cloud(300, 0), 2),
                          [&](nlohmann::json& meta) { meta["count"] = count; });
  for (auto& [name, content] : files)
    if (name != "meta.json") content = padded(one_colour, 32'000);
  EXPECT_EQ(parse(zip(files)).cloud.size(), count) << "so many bytes could hold them";
  EXPECT_EQ(refusal(files, true), (Refusal{"scene.sog/meta.json", "count"}));

  files = with_meta(files, [](nlohmann::json& meta) {
    meta["means"]["files"] = {"image.webp", "./image.webp"};
    for (const char* attribute : {"quats", "scales", "sh0"})
      meta[attribute]["files"] = {"image.webp"};
  });
  write("meta.json", files.at("meta.json"));
  write("image.webp", padded(one_colour, 32'000));
  EXPECT_EQ(refusal_of([&] { read_sog_meta(FolderFiles(folder_.path()), "meta.json"); }),
            (Refusal{(folder_ / "meta.json").string(), "count"}));
}

TEST(Sog, ArchivesThatGrowAreRefused) {
  const Files bomb = {{"meta.json", std::string(4 << 20, ' ')}};
  EXPECT_EQ(refusal(bomb, true), (Refusal{"scene.sog", "entry meta.json"}));
  for (std::size_t bytes = (1 << 20) + 4096; bytes < (1 << 20) + 8192; bytes += 256) {
    const std::string archive = zip({{"spaces", std::string(bytes, ' ')}}, true);
    const MemorySource file("scene.sog", bytes_of(archive));
    if (bytes <= 4 * archive.size() + 1'048'576)
      EXPECT_NO_THROW(ZipFiles{file}) << bytes;
    else
      EXPECT_EQ(refusal_of([&] { ZipFiles{file}; }), (Refusal{"scene.sog", "entry spaces"}));
  }
  Files many;
  for (int i = 0; i < 65536; ++i) many[std::to_string(i)] = "";
  EXPECT_EQ(refusal(many), (Refusal{"scene.sog", "entry meta.json"}));
  many["65536"] = "";
  EXPECT_EQ(refusal(many), (Refusal{"scene.sog", ""}));
}

TEST(Sog, ImagesHaveATexelPerGaussianAndNotManyMore) {
  const Files files = encode_sog(random_cloud(300, 0), 2);
  const auto parse_with = [&](std::size_t width, std::size_t height) {
    Files with = files;
    const std::string image = encode_webp(std::string(4 * width * height, '\0'),
                                          static_cast<int>(width), static_cast<int>(height));
    for (auto& [name, content] : with)
      if (name != "meta.json") content = image;
    return parse(zip(with));
  };
  EXPECT_NO_THROW(parse_with(300, 1));
  const Refusal size{"scene.sog/means_l.webp", "size"};
  EXPECT_EQ(refusal_of([&] { parse_with(299, 1); }), size);
  EXPECT_NO_THROW(parse_with(56, 1181)) << "2 x 300 + 65,536";
  EXPECT_EQ(refusal_of([&] { parse_with(438, 151); }), size);
}

/// A folder whose images become smaller once their sizes have been looked at.
class ShrinkingFolder final : public FileSet {
 public:
  ShrinkingFolder(Files files, std::string name, std::string then)
      : files_(std::move(files)), name_(std::move(name)), then_(std::move(then)) {}
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override {
    const bool replaced = name == name_ && opened_.exchange(true);
    return std::make_unique<MemorySource>(name, bytes_of(replaced ? then_ : files_.at(name)));
  }

 private:
  const Files files_;
  const std::string name_, then_;
  mutable std::atomic<bool> opened_{false};
};

TEST(Sog, ImagesReplacedWhileTheyAreReadAreRefused) {
  const Files files = encode_sog(random_cloud(300, 1), 2);
  const std::string small = encode_webp(std::string(4 * 4, '\0'), 2, 2);
  for (const auto& [name, content] : files) {
    if (name == "meta.json") continue;
    const ShrinkingFolder folder(files, name, small);
    EXPECT_EQ(refusal_of([&] { read_sog(folder, "meta.json", two_threads()); }),
              (Refusal{name, "size"}));
  }
}

TEST(Sog, DamagedFilesAreRefused) {
  const Files files = encode_sog(random_cloud(300, 1), 2);
  for (const auto& [name, content] : files) {
    Files cut = files;
    cut[name] = content.substr(0, content.size() / 2);
    EXPECT_EQ(refusal(cut).source, "scene.sog/" + name);
    cut[name] = "garbage";
    EXPECT_EQ(refusal(cut).source, "scene.sog/" + name);
  }
  Files lossy = files;
  lossy["quats.webp"] = encode_webp(std::string(4 * 20 * 16, 'q'), 20, 16, false);
  EXPECT_EQ(input_error([&] { parse(zip(lossy)); }),
            "scene.sog/quats.webp: byte 0: is not a lossless WebP image (SOG keeps exact bytes in "
            "its images; do not convert them)");
  const std::string archive = zip(files);
  for (const std::size_t length : {4, 100, 5000})
    EXPECT_EQ(refusal_of([&] { parse(archive.substr(0, length)); }).source, "scene.sog");
}

}  // namespace
}  // namespace catgs::test
