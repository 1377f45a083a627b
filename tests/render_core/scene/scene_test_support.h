#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/formats/ply.h"
#include "render_core/scene/gaussian_cloud.h"
#include "tests/render_core/scene/random_cloud.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {

inline std::string ply_bytes(const GaussianCloud& cloud) {
  std::ostringstream out;
  write_ply(cloud, out);
  return out.str();
}

inline std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

template <class T>
void append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

inline const LoadContext& two_threads() {
  static ThreadPool pool(2);
  static const LoadContext context(pool);
  return context;
}

/// What a lossy format may change, per field. 0 means bit for bit.
struct Tolerance {
  float mean = 0.0f;       // world units
  float log_scale = 0.0f;  // of the natural logarithm
  float rotation_rad = 0.0f;
  float opacity = 0.0f;
  float sh0 = 0.0f;
  float sh1 = 0.0f;      // degree 1
  float sh_rest = 0.0f;  // degrees 2 and 3
};

/// Angle in radians between two orientations, whatever the quaternions' signs.
inline float angle_between(const glm::quat& a, const glm::quat& b) {
  const glm::quat d = glm::conjugate(a) * b;
  return 2.0f * std::atan2(glm::length(glm::vec3(d.x, d.y, d.z)), std::abs(d.w));
}

inline void expect_near(const GaussianCloud& wanted, const GaussianCloud& read,
                        const Tolerance& tolerance) {
  ASSERT_EQ(read.size(), wanted.size());
  ASSERT_EQ(read.sh_degree, wanted.sh_degree);
  Tolerance worst;
  const auto take = [](float& to, float error) { to = std::max(to, std::abs(error)); };
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    take(worst.rotation_rad, angle_between(wanted.rotation[i], read.rotation[i]));
    take(worst.opacity, wanted.opacity[i] - read.opacity[i]);
    for (int k = 0; k < 3; ++k) {
      take(worst.mean, wanted.mean[i][k] - read.mean[i][k]);
      take(worst.log_scale, std::log(wanted.scale[i][k] / read.scale[i][k]));
      for (int c = 0; c < wanted.sh_count(); ++c)
        take(c == 0  ? worst.sh0
             : c < 4 ? worst.sh1
                     : worst.sh_rest,
             wanted.sh_of(i)[c][k] - read.sh_of(i)[c][k]);
    }
  }
  EXPECT_LE(worst.mean, tolerance.mean);
  EXPECT_LE(worst.log_scale, tolerance.log_scale);
  EXPECT_LE(worst.rotation_rad, tolerance.rotation_rad);
  EXPECT_LE(worst.opacity, tolerance.opacity);
  EXPECT_LE(worst.sh0, tolerance.sh0);
  EXPECT_LE(worst.sh1, tolerance.sh1);
  EXPECT_LE(worst.sh_rest, tolerance.sh_rest);
}

/// Largest angle between a rotation and its smallest-three encoding whose components are off by up
/// to `error`: the component that is left out, at least 1/2, is then off by up to 3 times that.
constexpr float smallest_three_angle(float error) { return 2.0f * 3.4641016f * error; }

/// A test case that reads and writes files.
class FolderTest : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& content) const {
    return folder_.write(name, content);
  }
  const TemporaryFolder folder_;
};

}  // namespace catgs::test
