#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "render_core/scene/activations.h"
#include "render_core/scene/formats/ply.h"

namespace catgs {

void write_ply(const GaussianCloud& cloud, std::ostream& to, const glm::dvec3& origin) {
  const std::size_t rest = cloud.sh_count() - 1;
  const bool precise = origin != glm::dvec3(0.0);
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  if (cloud.model != SplatModel::standard)
    header += fmt::format("comment SplatRenderMode: {}\n",
                          cloud.model == SplatModel::surfels ? name_of(cloud.model) : "mip");
  header += fmt::format("element vertex {}\n", cloud.size());
  const auto property = [&](std::string_view name) {
    header.append(precise && name.size() == 1 ? "property double " : "property float ");
    header.append(name).append("\n");
  };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"})
    property(name);
  for (std::size_t k = 0; k < 3 * rest; ++k) property(fmt::format("f_rest_{}", k));
  for (const char* name :
       {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    property(name);
  to << header << "end_header\n";

  constexpr std::size_t rows = 512;  // at a time
  const std::size_t row_floats = (precise ? 20 : 17) + 3 * rest;
  std::vector<float> block(rows * row_floats);
  for (std::size_t begin = 0; begin < cloud.size(); begin += rows) {
    const std::size_t end = std::min(cloud.size(), begin + rows);
    float* out = block.data();
    for (std::size_t i = begin; i < end; ++i) {
      const glm::vec3 *sh = cloud.sh_of(i), log_scale = log(cloud.scale[i]);
      const glm::quat& q = cloud.rotation[i];
      if (precise) {
        const auto position =
            std::bit_cast<std::array<float, 6>>(glm::dvec3(cloud.mean[i]) + origin);
        out = std::ranges::copy(position, out).out;
      } else {
        for (int k = 0; k < 3; ++k) *out++ = cloud.mean[i][k];
      }
      for (int k = 0; k < 3; ++k) *out++ = 0.0f;
      for (int k = 0; k < 3; ++k) *out++ = sh[0][k];
      for (int channel = 0; channel < 3; ++channel)
        for (std::size_t k = 0; k < rest; ++k) *out++ = sh[1 + k][channel];
      *out++ = logit(cloud.opacity[i]);
      for (int k = 0; k < 3; ++k) *out++ = log_scale[k];
      for (const float component : {q.w, q.x, q.y, q.z}) *out++ = component;
    }
    to.write(reinterpret_cast<const char*>(block.data()),
             static_cast<std::streamsize>((end - begin) * row_floats * sizeof(float)));
  }
}

}  // namespace catgs
