#include "tests/render_core/scene/formats/gltf_encoder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string_view>
#include <vector>

namespace catgs::test {

namespace {

struct Numbers {
  int component_type;
  std::size_t bytes;
  double largest;  // of a normalised one
};

Numbers numbers_of(std::string_view kind) {
  static const std::map<std::string_view, Numbers> all = {{"byte", {5120, 1, 127}},
                                                          {"unsigned_byte", {5121, 1, 255}},
                                                          {"short", {5122, 2, 32767}},
                                                          {"unsigned_short", {5123, 2, 65535}},
                                                          {"float", {5126, 4, 1}}};
  return all.at(kind.substr(0, kind.find(' ')));
}

struct Table {
  std::string name, kind;
  std::size_t columns;
  std::vector<float> values;

  [[nodiscard]] Numbers numbers() const { return numbers_of(kind); }
  [[nodiscard]] bool normalized() const { return kind.ends_with("normalized"); }
  [[nodiscard]] std::size_t row_bytes() const { return columns * numbers().bytes; }
  /// Rows padded to 4 bytes, as vertex attributes are aligned.
  [[nodiscard]] std::size_t padded_bytes() const { return (row_bytes() + 3) / 4 * 4; }

  [[nodiscard]] std::string row(std::size_t i) const {
    std::string bytes;
    for (std::size_t c = 0; c < columns; ++c) {
      const float value = values[i * columns + c];
      if (kind == "float") {
        bytes.append(reinterpret_cast<const char*>(&value), 4);
        continue;
      }
      const auto whole =
          static_cast<std::int32_t>(std::lround(value * (normalized() ? numbers().largest : 1.0)));
      bytes.append(reinterpret_cast<const char*>(&whole), numbers().bytes);
    }
    bytes.resize(padded_bytes(), '\0');
    return bytes;
  }
};

std::vector<Table> tables_of(const GaussianCloud& cloud, const GltfStyle& style) {
  // Half a turn about z.
  constexpr std::array<float, 16> sh_signs = {1, -1, 1, -1, 1, -1, 1, -1,
                                              1, -1, 1, -1, 1, -1, 1, -1};
  const std::string khr = "KHR_gaussian_splatting:";
  std::vector<Table> all = {{"POSITION", style.position, 3, {}},
                            {khr + "ROTATION", style.rotation, 4, {}},
                            {khr + "SCALE", style.scale, 3, {}},
                            {khr + "OPACITY", style.opacity, 1, {}}};
  for (int degree = 0; degree <= cloud.sh_degree; ++degree)
    for (int m = 0; m <= 2 * degree; ++m)
      all.push_back({khr + "SH_DEGREE_" + std::to_string(degree) + "_COEF_" + std::to_string(m),
                     style.sh,
                     3,
                     {}});
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const glm::vec3 &m = cloud.mean[i], &s = cloud.scale[i];
    const glm::quat& q = cloud.rotation[i];
    const auto add = [&](std::size_t table, std::initializer_list<float> values) {
      all[table].values.insert(all[table].values.end(), values);
    };
    add(0, {-m.x, -m.y, m.z});
    add(1, {q.y, -q.x, -q.w, q.z});
    add(2, {s.x, s.y, s.z});
    add(3, {cloud.opacity[i]});
    for (int k = 0; k < cloud.sh_count(); ++k) {
      const glm::vec3 sh = sh_signs[static_cast<std::size_t>(k)] * cloud.sh_of(i)[k];
      add(4 + static_cast<std::size_t>(k), {sh.x, sh.y, sh.z});
    }
  }
  return all;
}

void put(std::string& out, std::size_t word) {
  const auto value = static_cast<std::uint32_t>(word);
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

std::string glb(const std::string& json, const std::string& binary) {
  const auto padded = [](std::string bytes, char with) {
    bytes.append((4 - bytes.size() % 4) % 4, with);
    return bytes;
  };
  const std::string text = padded(json, ' '), data = padded(binary, '\0');
  std::string out = "glTF";
  put(out, 2);
  put(out, 12 + 8 + text.size() + 8 + data.size());
  put(out, text.size());
  out += "JSON" + text;
  put(out, data.size());
  return out.append("BIN\0", 4) + data;
}

GltfParts encode_gltf(const GaussianCloud& cloud, const GltfStyle& style) {
  const std::vector<Table> tables = tables_of(cloud, style);
  GltfParts parts;
  nlohmann::json views, accessors, attributes;
  std::size_t record_bytes = 0;
  for (const Table& table : tables) record_bytes += table.padded_bytes();
  if (style.interleaved) {
    views.push_back(
        {{"buffer", 0}, {"byteLength", record_bytes * cloud.size()}, {"byteStride", record_bytes}});
    for (std::size_t i = 0; i < cloud.size(); ++i)
      for (const Table& table : tables) parts.binary += table.row(i);
  }
  std::size_t offset = 0;
  for (const Table& table : tables) {
    nlohmann::json accessor = {
        {"componentType", table.numbers().component_type},
        {"count", cloud.size()},
        {"type", std::array{"", "SCALAR", "VEC2", "VEC3", "VEC4"}[table.columns]}};
    if (table.normalized()) accessor["normalized"] = true;
    if (style.interleaved) {
      accessor["bufferView"] = 0;
      accessor["byteOffset"] = offset;
      offset += table.padded_bytes();
    } else {
      accessor["bufferView"] = views.size();
      const std::size_t bytes = table.padded_bytes() * cloud.size();
      views.push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}});
      if (table.padded_bytes() != table.row_bytes())
        views.back()["byteStride"] = table.padded_bytes();
      for (std::size_t i = 0; i < cloud.size(); ++i) parts.binary += table.row(i);
      offset += bytes;
    }
    attributes[table.name] = accessors.size();
    accessors.push_back(accessor);
  }
  parts.json = nlohmann::json::parse(R"({"asset": {"version": "2.0"}, "scene": 0,
    "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"mode": 0,
    "extensions": {"KHR_gaussian_splatting": {"kernel": "ellipse",
    "colorSpace": "srgb_rec709_display"}}}]}], "extensionsUsed": ["KHR_gaussian_splatting"]})");
  parts.json["meshes"][0]["primitives"][0]["attributes"] = attributes;
  parts.json["accessors"] = accessors;
  parts.json["bufferViews"] = views;
  parts.json["buffers"][0]["byteLength"] = parts.binary.size();
  return parts;
}

GltfParts gltf_with_spz(const std::string& spz) {
  GltfParts parts;
  parts.json = nlohmann::json::parse(R"({"asset": {"version": "2.0"}, "scene": 0,
    "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"mode": 0,
    "attributes": {"POSITION": 0}, "extensions": {"KHR_gaussian_splatting": {"extensions": {
    "KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}}}}}]}],
    "accessors": [{"componentType": 5126, "type": "VEC3", "count": 1}],
    "bufferViews": [{"buffer": 0}], "extensionsRequired": ["KHR_materials_unlit",
    "KHR_gaussian_splatting", "KHR_gaussian_splatting_compression_spz_2"]})");
  parts.binary = spz;
  parts.json["buffers"][0]["byteLength"] = spz.size();
  parts.json["bufferViews"][0]["byteLength"] = spz.size();
  return parts;
}

}  // namespace catgs::test
