#pragma once

#include <memory>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "render_core/scene/formats/gltf.h"
#include "tests/render_core/scene/formats/gltf_encoder.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {

class NoFiles final : public FileSet {
 public:
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override {
    throw InputError(name, "", "is missing");
  }
};

inline GltfFile parse_gltf(const std::string& bytes, const FileSet& beside = NoFiles()) {
  return read_gltf(MemorySource("scene.glb", bytes_of(bytes)), beside, two_threads());
}

inline nlohmann::json& primitive_of(nlohmann::json& json) {
  return json["meshes"][0]["primitives"][0];
}

}  // namespace catgs::test
