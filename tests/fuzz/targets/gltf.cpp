#include "render_core/scene/formats/gltf.h"

#include <fmt/format.h>

#include "render_core/scene/formats/gltf_document.h"
#include "tests/fuzz/target.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/gltf_encoder.h"
#include "tests/render_core/scene/random_cloud.h"

namespace catgs::fuzz {
namespace {

/// A folder whose every file has the same few bytes.
class AnyFile final : public FileSet {
 public:
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override {
    static const std::string content(512, '\x3c');
    return std::make_unique<MemorySource>(name, bytes_of(content));
  }
};

/// The chunks of a .glb: its JSON, a zero byte, its data. Their sizes would refuse most mutants.
std::size_t json_end(const std::string& text) { return std::min(text.find('\0'), text.size()); }

void parse_gltf(Bytes input) {
  const std::string text = text_of(input);
  const std::size_t end = json_end(text);
  const bool chunks = end < text.size() && !text.starts_with("glTF");
  const std::string packed = chunks ? test::glb(text.substr(0, end), text.substr(end + 1)) : text;
  const MemorySource file("input", bytes_of(packed));
  const AnyFile beside;
  const GltfSize size = read_gltf_size(file, beside);
  const GaussianCloud cloud = read_gltf(file, beside, one_thread()).cloud;
  require(cloud.size() == size.count && cloud.sh_degree == size.sh_degree,
          "as many are read as were announced");
  require_sound(cloud);
}

void change_gltf(const Material& from, std::string& text) {
  const std::size_t end = json_end(text);
  std::string json = text.substr(0, end), data = text.substr(end);
  if (!from.one_in(4) || data.empty()) {
    const std::string& other = from.any_of(from.inputs);
    const std::string piece = other.substr(0, json_end(other));
    change_json({from.random, {&piece, 1}, from.words}, json);
  } else {
    change_bytes(from, data);
  }
  text = json + data;
}

std::map<std::string, std::string> gltf_seeds() {
  const auto seed = [](const test::GltfParts& parts) {
    return parts.json.dump().append(1, '\0') + parts.binary;
  };
  std::map<std::string, std::string> seeds;
  for (const int degree : {0, 1})
    seeds[fmt::format("floats_{}", degree)] =
        seed(test::encode_gltf(test::random_cloud(3, degree), {.interleaved = degree == 1}));
  const test::GltfStyle quantised{.position = "short",
                                  .rotation = "byte normalized",
                                  .scale = "unsigned_byte normalized",
                                  .opacity = "unsigned_short normalized"};
  seeds["quantised"] = seed(test::encode_gltf(test::random_cloud(3, 0), quantised));
  test::GltfParts nodes = test::encode_gltf(test::random_cloud(2, 0));
  nodes.json["nodes"] = nlohmann::json::parse(R"([{"children": [1, 2], "rotation": [0, 0, 1, 0]},
    {"mesh": 0, "scale": [1, 2, 3]}, {"mesh": 0, "translation": [1, 0, 0]},
    {"matrix": [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 5, 5, 5, 1]}])");
  seeds["nodes"] = seed(nodes);
  nodes.json["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]["colorSpace"] =
      "lin_rec709_display";
  seeds["linear"] = seed(nodes);
  seeds["spz"] =
      seed(test::gltf_with_spz(test::encode_spz(test::random_cloud(3, 1), {.version = 4})));
  test::GltfParts sparse = test::encode_gltf(test::random_cloud(3, 0));
  sparse.json["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", sparse.binary.size()}, {"byteLength", 13}});
  sparse.binary += '\1' + std::string(12, '\0');
  sparse.json["accessors"][0]["sparse"] = nlohmann::json::parse(R"({"count": 1, "indices":
    {"bufferView": 5, "componentType": 5121}, "values": {"bufferView": 5, "byteOffset": 1}})");
  sparse.json["accessors"][4].erase("bufferView");
  seeds["sparse"] = seed(sparse);
  seeds["whole"] = test::encode_gltf(test::random_cloud(1, 0)).glb();
  nodes.json["buffers"][0]["uri"] = "a.bin";
  seeds["beside"] = nodes.json.dump();
  nodes.json["buffers"][0]["uri"] = fmt::format("data:;base64,{:P>300}", "");
  seeds["data"] = nodes.json.dump();
  return seeds;
}

}  // namespace

std::vector<Target> gltf_targets() {
  return {{.name = "gltf",
           .parse = parse_gltf,
           .seeds = gltf_seeds,
           .dictionary = words_of(
               R"("accessors": "bufferViews": "buffers": "byteOffset": "byteStride": "byteLength":
                  "componentType": "normalized": "count": "type": "VEC3" "VEC4" "SCALAR" 5120 5121
                  5122 5123 5126 "nodes": "children": "matrix": "mesh": "scenes": "scene": "uri":
                  "primitives": "attributes": "POSITION": "KHR_gaussian_splatting": "extensions":
                  "KHR_gaussian_splatting_compression_spz_2": "bufferView": "sparse": "indices":
                  "values": "antialiased": true 5125)"),
           .change = change_gltf,
           .max_bytes = 8192}};
}

}  // namespace catgs::fuzz
