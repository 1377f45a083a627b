// Scenes of many files with levels of detail: 3D Tiles and LCC2.
#include <iterator>
#include <optional>
#include <vector>

#include "render_core/scene/formats/lcc.h"
#include "render_core/scene/formats/lcc2.h"
#include "render_core/scene/formats/tiles.h"
#include "tests/fuzz/target.h"
#include "tests/fuzz/targets/packed_files.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_encoder.h"
#include "tests/render_core/scene/random_cloud.h"

namespace catgs::fuzz {
namespace {

/// Files whose .glb are stored as their JSON, a zero byte and their data. The sizes of chunks would
/// refuse most mutants.
class FilesWithGlb final : public PackedFiles {
 public:
  explicit FilesWithGlb(Bytes bytes) : PackedFiles(bytes) {}
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override {
    auto file = PackedFiles::open(name);
    if (!name.ends_with(".glb")) return file;
    const std::vector<std::byte> bytes = file->read_all(1 << 20);
    const std::string text = text_of(bytes);
    const std::size_t end = std::min(text.find('\0'), text.size());
    std::string& glb = made_[name];
    glb = test::glb(text.substr(0, end), text.substr(std::min(end + 1, text.size())));
    return std::make_unique<MemorySource>(name, bytes_of(glb));
  }

 private:
  mutable std::map<std::string, std::string> made_;
};

template <class Files, class Open>
void parse_levels(Bytes input, const Open& open) {
  const auto files = std::make_shared<const Files>(input);
  bool read = false;
  for (const std::optional<std::size_t> budget : {std::optional<std::size_t>(), {20}}) try {
      const OpenLevels scene = open(files, budget);
      require(!budget || scene.count <= *budget, "a budget is kept");
      const GaussianCloud cloud = read_levels(scene, one_thread());
      require(cloud.size() == scene.count && cloud.sh_degree == scene.sh_degree,
              "as many are read as were counted");
      require_sound(cloud);
      read = true;
    } catch (const InputError&) {
    }
  if (!read) throw InputError("input", "", "is no scene");
}

void parse_tiles(Bytes input) {
  parse_levels<FilesWithGlb>(input, [](const auto& files, std::optional<std::size_t> budget) {
    return open_tiles(files, "tileset.json", {}, budget);
  });
}

void parse_lcc(Bytes input) {
  parse_levels<PackedFiles>(input, [](const auto& files, std::optional<std::size_t> budget) {
    return open_lcc(files, "a.lcc", {}, budget);
  });
}

void parse_lcc2(Bytes input) {
  parse_levels<PackedFiles>(input, [](const auto& files, std::optional<std::size_t> budget) {
    return open_lcc2(files, "a.lcc2", {}, budget);
  });
}

/// One of the files, as its format has it.
void change_levels(const Material& from, std::string& text) {
  std::map<std::string, std::string> files;
  for (const auto& [name, content] : unpacked(bytes_of(text))) files[name] = text_of(content);
  const auto others = unpacked(bytes_of(from.any_of(from.inputs)));
  if (files.empty() || others.empty()) return change_bytes(from, text);
  const auto any = [&](auto& map) {
    return std::next(map.begin(), static_cast<std::ptrdiff_t>(from.below(map.size())));
  };
  const auto changed = any(files);
  const auto other = others.find(changed->first);
  const std::string piece = text_of(other == others.end() ? any(others)->second : other->second);
  std::string& content = changed->second;
  const std::size_t end = std::min(content.find('\0'), content.size());
  if (from.one_in(16)) {
    files.erase(changed);
  } else if (content.starts_with('{') && !from.one_in(4)) {
    std::string json = content.substr(0, end);
    const std::string json_piece = piece.substr(0, piece.find('\0'));
    change_json({from.random, {&json_piece, 1}, from.words}, json);
    content = json + content.substr(end);
  } else {
    change_bytes(from, content);
  }
  text = packed(files);
}

std::string spz(std::size_t count, int degree) {
  return test::encode_spz(test::random_cloud(count, degree), {.version = 4});
}

std::string stored(const test::GltfParts& parts) {
  return parts.json.dump().append(1, '\0') + parts.binary;
}

std::map<std::string, std::string> tiles_seeds() {
  const std::map<std::string, std::string> tiles = {
      {"a.glb", stored(test::encode_gltf(test::random_cloud(2, 0)))},
      {"b.glb", stored(test::encode_gltf(test::random_cloud(3, 1)))},
      {"c/d.glb", stored(test::gltf_with_spz(spz(4, 0)))}};
  const auto folder = [&](const std::string& tileset, const std::string& inner) {
    std::map<std::string, std::string> files = tiles;
    files["tileset.json"] = tileset;
    if (!inner.empty()) files["c/t.json"] = inner;
    return packed(files);
  };
  return {{"replace", folder(R"({"asset":{"version":"1.1"},"root":{"refine":"REPLACE","content":
             {"uri":"a.glb"},"boundingVolume":{"box":[0,0,0,1,0,0,0,1,0,0,0,1]},"transform":
             [1,0,0,0,0,1,0,0,0,0,1,0,5,6,7,1],"children":[{"content":{"uri":"b.glb"}},
             {"contents":[{"uri":"c/d.glb"}]}]}})",
                             "")},
          {"nested", folder(R"({"asset":{"version":"1.0"},"root":{"refine":"ADD","boundingVolume":
             {"region":[1,0.5,1,0.5,0,9]},"content":{"url":"a.glb"},"children":[{"content":{"uri":
             "c/t.json"}}]}})",
                            R"({"asset":{"version":"1.1"},"root":{"content":{"uri":"../b.glb"},
             "boundingVolume":{"sphere":[0,0,0,1]},"children":[{"content":{"uri":"d.glb"}}]}})")},
          {"implicit",
           folder(R"({"asset":{"version":"1.1"},"root":{"refine":"ADD","content":
             {"uri":"c/d.glb"},"implicitTiling":{"subdivisionScheme":"OCTREE",
             "availableLevels":1,"subtreeLevels":1,"subtrees":{"uri":"c/t.json"}}}})",
                  R"({"tileAvailability":{"constant":1},"contentAvailability":[{"constant":1}],
             "childSubtreeAvailability":{"constant":0}})")}};
}

/// `levels` of a cell with so many Gaussians, and as many around it.
std::string lcc_seed(const std::vector<std::int32_t>& levels, bool has_sh) {
  std::string index(4, '\0'), data, sh;
  const auto append = [&index]<class T>(T value) {
    index.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  for (const std::int32_t count : levels) {
    append(count);
    append(static_cast<std::int64_t>(data.size()));
    append(32 * count);
    data.append(static_cast<std::size_t>(32 * count), '\x3d');
    sh.append(static_cast<std::size_t>(64 * count), '\x77');
  }
  const std::string range = R"(","min":[0.1,0.1,0.1],"max":[2,2,2]})";
  return packed(
      {{"a.lcc", R"({"totalLevel":)" + std::to_string(levels.size()) +
                     R"(,"encoding":"COMPRESS","fileType":")" + (has_sh ? "Quality" : "Portable") +
                     R"(","attributes":[{"name":"scale)" + range + R"(,{"name":"shcoef)" + range +
                     R"(,{"name":"envscale)" + range + "]}"},
       {"index.bin", index},
       {"data.bin", data},
       {"shcoef.bin", sh},
       {"environment.bin", data}});
}

std::map<std::string, std::string> lcc_seeds() {
  return {{"portable", lcc_seed({4, 2}, false)}, {"quality", lcc_seed({3, 0, 3}, true)}};
}

std::map<std::string, std::string> lcc2_seeds() {
  const auto folder = [](const std::string& index, const std::string& extension) {
    std::map<std::string, std::string> files = {{"a.lcc2", index}};
    for (const auto& [name, count] : {std::pair("0", 9), {"1", 4}, {"e", 2}})
      files[name + extension] =
          extension == ".spz" ? spz(static_cast<std::size_t>(count), 1)
                              : test::zip(test::encode_sog(
                                    test::random_cloud(static_cast<std::size_t>(count), 0), 1));
    return packed(files);
  };
  return {{"spz", folder(R"({"version":"0.0.3","splatType":".spz","root":{"splatFiles":["0.spz",
             "1.spz","e.spz"],"data":{"env":{"name":2}},"child":{"0":{"data":{"3dgs":{"name":1,
             "start":0,"count":4}},"child":{"0":{"data":{"3dgs":{"name":0,"start":0,"count":5}}},
             "1":{"data":{"3dgs":{"name":0,"start":5,"count":4}}}}}}}})",
                         ".spz")},
          {"sog", folder(R"({"splatType":".sog","root":{"files":["/0","1.sog"],"data":null,
             "child":[{"data":{"3dgs":{"name":1,"count":3}},"child":null},{"data":{"3dgs":{"name":0,
             "start":2,"count":6}}}]}})",
                         ".sog")}};
}

}  // namespace

std::vector<Target> levels_targets() {
  return {{.name = "tiles",
           .parse = parse_tiles,
           .seeds = tiles_seeds,
           .dictionary = words_of(
               R"("asset": "version": "1.0" "1.1" "root": "children": "content": "contents": "uri":
                  "url": "refine": "ADD" "REPLACE" "transform": "boundingVolume": "box": "sphere":
                  "region": "extensionsRequired": "implicitTiling": "a.glb" "b.glb" "c/d.glb"
                  "c/t.json" "../b.glb" "tileset.json" b3dm)"),
           .change = change_levels,
           .max_bytes = 16384},
          {.name = "lcc",
           .parse = parse_lcc,
           .seeds = lcc_seeds,
           .dictionary = words_of(
               R"("totalLevel": "attributes": "name": "min": "max": "scale" "shcoef" "envscale"
                  "envshcoef" "encoding": "COMPRESS" "fileType": "Portable" "Quality")"),
           .change = change_levels,
           .max_bytes = 16384},
          {.name = "lcc2",
           .parse = parse_lcc2,
           .seeds = lcc2_seeds,
           .dictionary = words_of(
               R"("version": "0.0.3" "splatType": ".spz" ".sog" "root": "splatFiles": "files":
                  "data": "env": "name": "3dgs": "start": "count": "child": "0": "1": null
                  "0.spz" "1.spz" "e.spz" "0.sog" "1.sog")"),
           .change = change_levels,
           .max_bytes = 16384}};
}

}  // namespace catgs::fuzz
