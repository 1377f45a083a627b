#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs::test {

/// A .glb with these chunks.
std::string glb(const std::string& json, const std::string& binary);

/// The numbers of an attribute: "float", "byte", "unsigned_byte", "short" or "unsigned_short", with
/// " normalized" behind it.
struct GltfStyle {
  std::string position = "float", rotation = "float", scale = "float", opacity = "float";
  std::string sh = "float";
  bool interleaved = false;  // an attribute beside the other of each Gaussian
};

struct GltfParts {
  nlohmann::json json;
  std::string binary;
  [[nodiscard]] std::string glb() const { return test::glb(json.dump(), binary); }
};

/// Written from the descriptions of glTF and KHR_gaussian_splatting, independently of our writer.
/// The scene has one node.
GltfParts encode_gltf(const GaussianCloud& cloud, const GltfStyle& style = {});

/// The same with an .spz as KHR_gaussian_splatting_compression_spz_2 has it.
GltfParts gltf_with_spz(const std::string& spz);

}  // namespace catgs::test
