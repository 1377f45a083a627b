#include "render_core/synth/synth.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"

namespace catgs {
namespace {

constexpr SynthKind kinds[] = {SynthKind::city, SynthKind::garden, SynthKind::stress};

/// FNV-1a over every byte of every array.
std::uint64_t hash_of(const GaussianCloud& cloud) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  const auto add = [&](const auto& values) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(values.data());
    for (std::size_t i = 0; i < values.size() * sizeof(values[0]); ++i) {
      hash = (hash ^ bytes[i]) * 0x100000001b3ull;
    }
  };
  add(cloud.mean);
  add(cloud.rotation);
  add(cloud.scale);
  add(cloud.opacity);
  add(cloud.sh);
  return hash;
}

bool is_finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

std::string name_of(const testing::TestParamInfo<SynthKind>& kind) {
  switch (kind.param) {
    case SynthKind::city:
      return "city";
    case SynthKind::garden:
      return "garden";
    case SynthKind::stress:
      break;
  }
  return "stress";
}

class SynthKinds : public testing::TestWithParam<SynthKind> {};

TEST_P(SynthKinds, MakesExactlyAsManyValidGaussiansAsAsked) {
  for (const std::size_t count : {1'000u, 1'001u, 9'973u, 60'000u}) {
    const GaussianCloud cloud = synthesize(GetParam(), count, 3).cloud;
    ASSERT_EQ(cloud.size(), count);
    ASSERT_EQ(cloud.sh_degree, 3);
    ASSERT_EQ(cloud.sh.size(), count * 16);
    for (std::size_t i = 0; i < count; ++i) {
      ASSERT_TRUE(is_finite(cloud.mean[i])) << i;
      ASSERT_TRUE(is_finite(cloud.scale[i])) << i;
      ASSERT_GT(std::min({cloud.scale[i].x, cloud.scale[i].y, cloud.scale[i].z}), 0.0f) << i;
      ASSERT_GE(cloud.opacity[i], 1.0f / 255.0f) << i;  // nothing that readers would drop
      ASSERT_LT(cloud.opacity[i], 1.0f) << i;
      ASSERT_NEAR(glm::dot(cloud.rotation[i], cloud.rotation[i]), 1.0f, 1e-4f) << i;
      for (int k = 0; k < 16; ++k) ASSERT_TRUE(is_finite(cloud.sh_of(i)[k])) << i;
    }
  }
}

TEST_P(SynthKinds, TheNumberOfThreadsChangesNothing) {
  ThreadPool one(1), three(3);
  EXPECT_EQ(hash_of(synthesize(GetParam(), 30'000, 5, one).cloud),
            hash_of(synthesize(GetParam(), 30'000, 5, three).cloud));
}

TEST_P(SynthKinds, TheSeedChangesTheScene) {
  EXPECT_NE(hash_of(synthesize(GetParam(), 5'000, 1).cloud),
            hash_of(synthesize(GetParam(), 5'000, 2).cloud));
}

TEST_P(SynthKinds, HintsLieInsideTheirLimits) {
  const SceneHints hints = synthesize(GetParam(), 20'000, 1).hints;
  for (const glm::vec3& p : {hints.start_pose.position, hints.focus}) {
    EXPECT_TRUE(glm::all(glm::greaterThanEqual(p, hints.limits.min)));
    EXPECT_TRUE(glm::all(glm::lessThanEqual(p, hints.limits.max)));
  }
  EXPECT_GT(hints.near_z, 0.0f);
  EXPECT_FALSE(hints.source.empty());
}

INSTANTIATE_TEST_SUITE_P(All, SynthKinds, testing::ValuesIn(kinds), name_of);

// The bytes that GCC and Clang made, at -O0 to -O3 and with AVX-512. Whoever changes how a scene
// looks pins it anew; whoever did not has lost determinism.
TEST(Synth, ASeedMakesTheSameBytesOnEveryMachine) {
  EXPECT_EQ(hash_of(synthesize(SynthKind::city, 4'096, 1).cloud), 0xb8b2b71a8357708bull);
  EXPECT_EQ(hash_of(synthesize(SynthKind::city, 50'000, 1).cloud), 0x2c7e9a4f85c6561full);
  EXPECT_EQ(hash_of(synthesize(SynthKind::garden, 50'000, 1).cloud), 0x995894d20516b270ull);
  EXPECT_EQ(hash_of(synthesize(SynthKind::stress, 50'000, 1).cloud), 0x87ca5412dd0c609cull);
}

class SynthCaptures : public testing::TestWithParam<SynthKind> {};

TEST_P(SynthCaptures, HasTheStatisticsOfATrainedCapture) {
  const GaussianCloud cloud = synthesize(GetParam(), 100'000, 1).cloud;
  const auto n = static_cast<double>(cloud.size());
  std::vector<double> flatness, log_size;
  double solid = 0, faint = 0, view_dependent = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    glm::vec3 s = cloud.scale[i];
    std::sort(&s.x, &s.x + 3);
    flatness.push_back(s.y / s.x);
    log_size.push_back(std::log(s.y));
    solid += cloud.opacity[i] > 0.9f;
    faint += cloud.opacity[i] < 0.5f;
    float energy = 0.0f;
    for (int k = 9; k < 16; ++k) energy += glm::dot(cloud.sh_of(i)[k], cloud.sh_of(i)[k]);
    view_dependent += energy > 1e-6f;
  }
  std::nth_element(flatness.begin(), flatness.begin() + flatness.size() / 2, flatness.end());
  EXPECT_GT(flatness[flatness.size() / 2], 3.0);  // flat: the normal axis is the thin one
  EXPECT_GT(solid / n, 0.6);                      // bimodal opacity
  EXPECT_GT(faint / n, 0.01);
  EXPECT_LT(faint / n, 0.3);
  EXPECT_GT(view_dependent / n, 0.5);
  double mean = 0, variance = 0;
  for (const double x : log_size) mean += x / n;
  for (const double x : log_size) variance += (x - mean) * (x - mean) / n;
  EXPECT_GT(std::sqrt(variance), 0.4);  // sizes spread over orders of magnitude
}

INSTANTIATE_TEST_SUITE_P(All, SynthCaptures, testing::Values(SynthKind::city, SynthKind::garden),
                         name_of);

TEST(Synth, ALargerCityKeepsItsMiddle) {
  const GaussianCloud small = synthesize(SynthKind::city, 1'000'000, 1).cloud;
  const GaussianCloud large = synthesize(SynthKind::city, 1'300'000, 1).cloud;
  // Blocks come from the centre outwards, so the middle is a common start of both clouds.
  constexpr std::size_t middle = 500'000;
  EXPECT_TRUE(std::equal(small.mean.begin(), small.mean.begin() + middle, large.mean.begin()));
  EXPECT_TRUE(std::equal(small.scale.begin(), small.scale.begin() + middle, large.scale.begin()));
  for (const glm::vec3& scale : large.scale) ASSERT_GT(scale.x, 0.0f);  // of every kind of block
  const auto in_the_middle = [](const GaussianCloud& cloud) {
    return std::count_if(cloud.mean.begin(), cloud.mean.end(), [](const glm::vec3& p) {
      return std::abs(p.x) < 60.0f && std::abs(p.z - 40.0f) < 60.0f && p.y > -100.0f;
    });
  };
  EXPECT_GT(in_the_middle(small), 100'000);
  EXPECT_EQ(in_the_middle(small), in_the_middle(large));
}

TEST(Synth, PartsMakeTheWholeScene) {
  ThreadPool pool(2);
  const GaussianCloud whole = synthesize(SynthKind::city, 2'300'000, 1, pool).cloud;
  std::size_t taken = 0, parts = 0;
  const SceneHints hints =
      synthesize_parts(SynthKind::city, 2'300'000, 1, pool, [&](const GaussianCloud& part) {
        ASSERT_LE(taken + part.size(), whole.size());
        EXPECT_TRUE(std::equal(part.mean.begin(), part.mean.end(), whole.mean.begin() + taken));
        EXPECT_TRUE(std::equal(part.sh.begin(), part.sh.end(), whole.sh.begin() + 16 * taken));
        taken += part.size();
        ++parts;
      });
  EXPECT_EQ(taken, whole.size());
  EXPECT_GT(parts, 1u);
  EXPECT_EQ(hints.source, "procedural");
}

TEST(Synth, RefusesWhatItCannotMake) {
  EXPECT_THROW(synthesize(SynthKind::city, 999, 1), InputError);
  EXPECT_THROW(synthesize(SynthKind::city, 64'000'001, 1), InputError);
  EXPECT_THROW(parse_synth_kind("castle"), InputError);
  ThreadPool pool(1);
  const auto parts = [&](std::size_t count) {
    synthesize_parts(SynthKind::city, count, 1, pool, [](const GaussianCloud&) {});
  };
  EXPECT_THROW(parts(999), InputError);
  EXPECT_THROW(parts((std::size_t{1} << 34) + 1), InputError);
  EXPECT_EQ(parse_synth_kind("garden"), SynthKind::garden);
}

}  // namespace
}  // namespace catgs
