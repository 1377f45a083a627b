#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/formats/axes.h"
#include "render_core/scene/formats/gltf.h"
#include "render_core/scene/formats/gltf_document.h"

namespace catgs {

namespace {

/// A vertex attribute. `append` adds the bytes of Gaussian i.
struct Attribute {
  std::string name;
  std::size_t columns;
  GltfComponent component;
  std::function<void(std::string& to, std::size_t i)> append;

  [[nodiscard]] std::uint64_t row_bytes() const {
    return columns * (component == GltfComponent::float32 ? sizeof(float) : 1);
  }
};

template <class T>
void put(std::string& to, const T& value) {
  to.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// The byte for linear light of an sRGB component: what viewers without the extension show.
unsigned char linear_byte(float encoded) {
  const float v = std::clamp(encoded, 0.0f, 1.0f);
  return to_byte(255.0f * (v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f)));
}

std::vector<Attribute> attributes_of(const GaussianCloud& cloud) {
  const AxisFlip flip({-1.0f, -1.0f, 1.0f});
  const std::string prefix = "KHR_gaussian_splatting:";
  std::vector<Attribute> all;
  const auto add = [&](std::string name, std::size_t columns, const auto& append) {
    all.push_back({std::move(name), columns, GltfComponent::float32, append});
  };
  add("POSITION", 3,
      [&cloud, flip](std::string& to, std::size_t i) { put(to, flip.mean(cloud.mean[i])); });
  add(prefix + "ROTATION", 4, [&cloud](std::string& to, std::size_t i) {
    const glm::quat half_turn_back(0.0f, 0.0f, 0.0f, -1.0f);
    const glm::quat q = half_turn_back * cloud.rotation[i];
    put(to, std::array{q.x, q.y, q.z, q.w});
  });
  add(prefix + "SCALE", 3, [&cloud](std::string& to, std::size_t i) { put(to, cloud.scale[i]); });
  add(prefix + "OPACITY", 1,
      [&cloud](std::string& to, std::size_t i) { put(to, cloud.opacity[i]); });
  for (int k = 0; k < cloud.sh_count(); ++k) {
    const int degree = sh_degree_of(k);
    const float sign = flip.sh(static_cast<std::size_t>(k));
    add(fmt::format("{}SH_DEGREE_{}_COEF_{}", prefix, degree, k - degree * degree), 3,
        [&cloud, sign, k](std::string& to, std::size_t i) { put(to, sign * cloud.sh_of(i)[k]); });
  }
  all.push_back(
      {"COLOR_0", 4, GltfComponent::unsigned_byte, [&cloud](std::string& to, std::size_t i) {
         for (int c = 0; c < 3; ++c) put(to, linear_byte(colour_from_sh(cloud.sh_of(i)[0][c])));
         put(to, to_byte(255.0f * cloud.opacity[i]));
       }});
  return all;
}

nlohmann::json json_of(const GaussianCloud& cloud, const glm::dvec3& origin,
                       const std::vector<Attribute>& attributes) {
  using nlohmann::json;
  constexpr std::array types = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};
  constexpr int array_buffer = 34962, points = 0;
  json views, accessors, indices;
  std::uint64_t offset = 0;
  for (const Attribute& attribute : attributes) {
    const std::uint64_t bytes = cloud.size() * attribute.row_bytes();
    views.push_back(
        {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}, {"target", array_buffer}});
    indices[attribute.name] = accessors.size();
    accessors.push_back({{"bufferView", accessors.size()},
                         {"componentType", static_cast<int>(attribute.component)},
                         {"count", cloud.size()},
                         {"type", types[attribute.columns]}});
    if (attribute.component != GltfComponent::float32) accessors.back()["normalized"] = true;
    offset += bytes;
  }
  glm::vec3 low(std::numeric_limits<float>::max()), high(std::numeric_limits<float>::lowest());
  for (const glm::vec3& mean : cloud.mean) {
    const glm::vec3 stored = glm::vec3(-1.0f, -1.0f, 1.0f) * mean;
    low = glm::min(low, stored);
    high = glm::max(high, stored);
  }
  accessors[0]["min"] = {low.x, low.y, low.z};
  accessors[0]["max"] = {high.x, high.y, high.z};
  const json extension = {{"kernel", "ellipse"}, {"colorSpace", "srgb_rec709_display"}};
  const json primitive = {{"attributes", indices},
                          {"mode", points},
                          {"extensions", {{"KHR_gaussian_splatting", extension}}}};
  const auto list_of = [](const json& entry) { return json::array({entry}); };
  json node = {{"mesh", 0}};
  if (origin != glm::dvec3(0.0)) node["translation"] = {-origin.x, -origin.y, origin.z};
  return {{"asset", {{"version", "2.0"}, {"generator", "CaT-GS"}}},
          {"extensionsUsed", list_of("KHR_gaussian_splatting")},
          {"scene", 0},
          {"scenes", list_of({{"nodes", list_of(0)}})},
          {"nodes", list_of(node)},
          {"meshes", list_of({{"primitives", list_of(primitive)}})},
          {"accessors", accessors},
          {"bufferViews", views},
          {"buffers", list_of({{"byteLength", offset}})}};
}

}  // namespace

void write_glb(const GaussianCloud& cloud, std::ostream& to, const glm::dvec3& origin) {
  const std::vector<Attribute> attributes = attributes_of(cloud);
  std::string json = json_of(cloud, origin, attributes).dump();
  json.append((4 - json.size() % 4) % 4, ' ');  // chunks begin at multiples of 4
  std::uint64_t binary_bytes = 0;
  for (const Attribute& attribute : attributes)
    binary_bytes += cloud.size() * attribute.row_bytes();
  const std::uint64_t size = 12 + 8 + json.size() + 8 + binary_bytes;
  if (size > std::numeric_limits<std::uint32_t>::max())
    throw InputError("", "size", fmt::format("{} Gaussians do not fit into .glb", cloud.size()),
                     "prune the scene, or write .ply");

  std::string block;
  const auto write = [&] {
    to.write(block.data(), static_cast<std::streamsize>(block.size()));
    block.clear();
  };
  const auto word = [](std::uint64_t value) { return static_cast<std::uint32_t>(value); };
  put(block, std::array{word(0x46546c67), word(2), word(size)});
  put(block, std::array{word(json.size()), word(0x4e4f534a)});
  block += json;
  put(block, std::array{word(binary_bytes), word(0x004e4942)});
  write();
  constexpr std::size_t rows = 4096;
  for (const Attribute& attribute : attributes)
    for (std::size_t begin = 0; begin < cloud.size(); begin += rows) {
      for (std::size_t i = begin; i < std::min(cloud.size(), begin + rows); ++i)
        attribute.append(block, i);
      write();
    }
}

}  // namespace catgs
