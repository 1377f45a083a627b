#include "render_core/scene/formats/spz.h"

#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <set>
#include <vector>

#include "render_core/math/spherical_harmonics-inl.h"
#include "render_core/scene/formats/format_limits.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

SpzFile parse(const std::string& bytes) {
  return read_spz(MemorySource("scene.spz", bytes_of(bytes)), two_threads());
}

/// Values inside the ranges that the format holds.
GaussianCloud storable_cloud(std::size_t count, int sh_degree) {
  GaussianCloud cloud = random_cloud(count, sh_degree);
  for (glm::vec3& sh : cloud.sh) sh = glm::clamp(sh, -0.99f, 0.99f);
  return cloud;
}

// Half a step each: scales 1/16, opacities 1/255, constant SH 1/(0.15 * 255), SH 1/128.
constexpr Tolerance byte_steps = {.mean = 0.000123f,
                                  .log_scale = 0.03126f,
                                  .rotation_rad = smallest_three_angle(0.5f * 0.70711f / 511),
                                  .opacity = 0.00197f,
                                  .sh0 = 0.01308f,
                                  .sh1 = 0.00391f,
                                  .sh_rest = 0.00391f};

TEST(Spz, VersionsAreReadAndTurnedToRightDownFront) {
  for (const int degree : {0, 1, 2, 3}) {
    const GaussianCloud cloud = storable_cloud(5000, degree);
    for (const int version : {1, 2, 3, 4}) {
      SCOPED_TRACE(testing::Message() << "version " << version << ", degree " << degree);
      const SpzFile spz = parse(encode_spz(cloud, {.version = version}));
      EXPECT_EQ(spz.version, version);
      Tolerance tolerance = byte_steps;
      // Version 1 has half floats: 11 bits of at most 16; below 3, w follows from three bytes and
      // is worst where it is small.
      if (version == 1) tolerance.mean = 0.004f;
      if (version < 3) tolerance.rotation_rad = 0.25f;
      expect_near(cloud, spz.cloud, tolerance);
    }
  }
}

TEST(Spz, RoundTripErrorsAreThoseStated) {
  Tolerance tolerance = byte_steps;
  tolerance.mean = std::ldexp(1.0f, -17);
  tolerance.sh1 = 1.0f / 32 + 1e-6f;
  tolerance.sh_rest = 1.0f / 16 + 1e-6f;
  for (const int degree : {0, 1, 2, 3}) {
    const GaussianCloud cloud = storable_cloud(20000, degree);
    std::ostringstream out;
    write_spz(cloud, out);
    const SpzFile spz = parse(out.str());
    EXPECT_EQ(spz.version, 3);
    expect_near(cloud, spz.cloud, tolerance);
  }
}

TEST(Spz, AFlagTellsAntialiasedScenes) {
  GaussianCloud cloud = storable_cloud(10, 0);
  for (const SplatModel model : {SplatModel::standard, SplatModel::antialiased}) {
    cloud.model = model;
    std::ostringstream out;
    write_spz(cloud, out);
    EXPECT_EQ(parse(out.str()).cloud.model, model);
  }
}

TEST(Spz, LargeScenesKeepTheirExtentWithFewerFractionalBits) {
  GaussianCloud cloud = random_cloud(1000, 0);
  // Too many to be far from all others.
  for (std::size_t i = 0; i < 20; ++i) cloud.mean[i] = glm::vec3(100000.0f, -1.0f, 5.0f);
  std::ostringstream out;
  write_spz(cloud, out);
  const GaussianCloud read = parse(out.str()).cloud;
  EXPECT_NEAR(read.mean[7].x, 100000.0f, 1.0f / 128);
  for (std::size_t i = 0; i < 20; ++i) cloud.mean[i].x = 1e7f;
  input_error([&] { write_spz(cloud, out); });
}

TEST(Spz, SmallScenesKeepTheirPositions) {
  GaussianCloud cloud = random_cloud(400, 0);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.mean[i] *= 2e-6f;
    cloud.scale[i] *= 1e-4f;
  }
  std::ostringstream out;
  write_spz(cloud, out);
  std::set<std::array<float, 3>> positions;
  for (const glm::vec3& mean : parse(out.str()).cloud.mean)
    positions.insert({mean.x, mean.y, mean.z});
  EXPECT_GT(positions.size(), 390u);
}

TEST(Spz, LossesAreTold) {
  using ::testing::ElementsAre;
  using ::testing::HasSubstr;
  const auto losses_with = [](const std::function<void(GaussianCloud&)>& change) {
    GaussianCloud cloud = storable_cloud(400, 1);
    change(cloud);
    return spz_losses(cloud);
  };
  EXPECT_TRUE(losses_with([](GaussianCloud&) {}).empty());
  EXPECT_THAT(losses_with([](GaussianCloud& cloud) {
                for (glm::vec3& scale : cloud.scale) scale = glm::vec3(7e-6f);
              }),
              ElementsAre(HasSubstr("400 of 400 Gaussians are smaller than 4.4e-05")));
  EXPECT_THAT(losses_with([](GaussianCloud& cloud) {
                for (glm::vec3& mean : cloud.mean) mean += 500'000.0f;
                for (glm::vec3& scale : cloud.scale) scale = glm::vec3(0.05f);
              }),
              ElementsAre(HasSubstr("steps of up to 0.0625, and 400 of 400 Gaussians")));
  EXPECT_THAT(losses_with([](GaussianCloud& cloud) { cloud.mean[3].y = -2e6f; }),
              ElementsAre(HasSubstr("1 of 400 Gaussians are far from all others")));
  EXPECT_THAT(losses_with([](GaussianCloud& cloud) { cloud.scale[3].y = 4000.0f; }),
              ElementsAre(HasSubstr("1 of 400 Gaussians are larger than 39")));
  EXPECT_THAT(losses_with([](GaussianCloud& cloud) {
                cloud.sh[0].y = 4.0f;
                cloud.sh[4].x = -4.0f;
                cloud.sh[9].x = 1.5f;
              }),
              ElementsAre(HasSubstr("2 of 400 Gaussians have colours outside of -0.44…1.44"),
                          HasSubstr("1 of 400 Gaussians have harmonics outside of -1…1")));
  // A needle or a disc is seen by its longer axes.
  EXPECT_TRUE(losses_with([](GaussianCloud& cloud) {
                for (glm::vec3& scale : cloud.scale) scale = {1e-7f, 0.01f, 0.01f};
              }).empty());
}

TEST(Spz, NotesTellWhatAFileLeavesOpen) {
  using ::testing::ElementsAre;
  using ::testing::HasSubstr;
  const GaussianCloud cloud = storable_cloud(30, 0);
  for (const int version : {3, 4}) {
    EXPECT_THAT(parse(encode_spz(cloud, {.version = version})).notes,
                ElementsAre(HasSubstr("--up=+y")));
    EXPECT_THAT(parse(encode_spz(cloud, {.version = version, .coordinate_system = 6})).notes,
                ElementsAre(HasSubstr("extension 0x12340001")));
  }
  std::string flags = encode_spz(cloud, {.version = 4, .coordinate_system = 6});
  flags[14] = static_cast<char>(flags[14] | 0x14);
  EXPECT_THAT(parse(flags).notes, ElementsAre(HasSubstr("flags 0x14"), HasSubstr("extension")));
}

TEST(Spz, AFarGaussianCostsTheOthersNothing) {
  GaussianCloud cloud = storable_cloud(300, 0);
  cloud.mean[7] = {0.0f, -2e6f, 0.0f};
  std::ostringstream out;
  write_spz(cloud, out);
  const SpzFile read = parse(out.str());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (i == 7) continue;
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(read.cloud.mean[i][k], cloud.mean[i][k], std::ldexp(1.0f, -17));
  }
  EXPECT_LT(read.cloud.mean[7].y, -1.0f);
  EXPECT_LT(read.cloud.scale[7].x, 1e-4f);
}

TEST(Spz, TheAxesExtensionIsObeyed) {
  const GaussianCloud cloud = storable_cloud(300, 3);
  for (const int version : {3, 4}) {
    SpzStyle style{.version = version, .coordinate_system = 6};  // right, down, front
    expect_near(cloud, parse(encode_spz(cloud, style)).cloud, byte_steps);
    EXPECT_TRUE(parse(encode_spz(cloud, style)).names_axes);
    EXPECT_FALSE(parse(encode_spz(cloud, {.version = version})).names_axes);
    style.coordinate_system = 5;  // left, down, front: x turned around
    const GaussianCloud turned = parse(encode_spz(cloud, style)).cloud;
    EXPECT_NEAR(turned.mean[0].x, -cloud.mean[0].x, 0.001f);
    EXPECT_NEAR(turned.mean[0].y, cloud.mean[0].y, 0.001f);
    style.coordinate_system = 17;
    EXPECT_EQ(refusal_of([&] { parse(encode_spz(cloud, style)); }),
              (Refusal{"scene.spz", "extension SPZ_ADOBE_coordinate_system"}));
  }
}

TEST(Spz, TheOrbitExtensionIsRead) {
  const GaussianCloud cloud = storable_cloud(30, 0);
  for (const int version : {3, 4}) {
    SpzStyle style{.version = version, .orbit = OrbitLimits{-0.25f, 1.5f, 2.0f}};
    const auto orbit = parse(encode_spz(cloud, style)).orbit;
    ASSERT_TRUE(orbit);
    EXPECT_EQ(orbit->min_elevation, -0.25f);
    EXPECT_EQ(orbit->max_elevation, 1.5f);
    EXPECT_EQ(orbit->min_radius, 2.0f);
    style.orbit = {-9.0f, 9.0f, -1.0f};
    const auto clamped = parse(encode_spz(cloud, style)).orbit;
    ASSERT_TRUE(clamped);
    EXPECT_NEAR(clamped->min_elevation, -1.570796f, 1e-6f);
    EXPECT_EQ(clamped->min_radius, 0.0f);
    style.orbit = OrbitLimits{};  // zeros say nothing
    EXPECT_FALSE(parse(encode_spz(cloud, style)).orbit);
    style.orbit = {0.0f, NAN, 0.0f};
    EXPECT_FALSE(parse(encode_spz(cloud, style)).orbit) << "the scene can be seen anyway";
  }
  EXPECT_FALSE(parse(encode_spz(cloud, {.version = 4})).orbit);
}

/// Right, down, front of a place whose axes are named by letters: "LUB" is left, up, back.
glm::dvec3 by_letters(const glm::dvec3& position, std::string_view axes) {
  glm::dvec3 turned(0.0);
  for (int k = 0; k < 3; ++k)
    for (const std::string_view pair : {"RL", "DU", "FB"})
      if (const auto at = pair.find(axes[static_cast<std::size_t>(k)]); at != pair.npos)
        turned[pair == "RL" ? 0 : pair == "DU" ? 1 : 2] = at == 0 ? position[k] : -position[k];
  return turned;
}

float green(const GaussianCloud& cloud, std::size_t i, const glm::dvec3& direction) {
  double basis[16], sum = 0.5;
  math::sh_basis<double>({direction.x, direction.y, direction.z}, cloud.sh_degree, basis);
  for (int k = 0; k < cloud.sh_count(); ++k) sum += basis[k] * cloud.sh_of(i)[k].y;
  return static_cast<float>(sum);
}

/// As the reference library turns: it flips the axes whose bits differ from those of right, down,
/// front, and then turns the systems from 9 on by a quarter about x.
glm::dvec3 by_library(glm::dvec3 position, std::uint32_t system) {
  constexpr std::uint32_t right_down_front = 6;
  const std::uint32_t differ = (system - 1) ^ (right_down_front - 1);
  for (int k = 0; k < 3; ++k)
    if (differ >> k & 1) position[k] = -position[k];
  return system < 9 ? position : glm::dvec3(position.x, position.z, -position.y);
}

constexpr std::array<std::string_view, 16> systems = {"LDB", "RDB", "LUB", "RUB", "LDF", "RDF",
                                                      "LUF", "RUF", "LFD", "RFD", "LFU", "RFU",
                                                      "LBD", "RBD", "LBU", "RBU"};

TEST(Spz, FourSystemsLieHalfATurnFromTheirLetters) {
  const glm::dvec3 position(1, 2, 3);
  for (std::uint32_t s = 1; s <= 16; ++s) {
    const glm::dvec3 half_a_turn(1, -1, -1);
    const bool differs = s == 9 || s == 10 || s >= 15;
    EXPECT_EQ(by_library(position, s),
              by_letters(position, systems[s - 1]) * (differs ? half_a_turn : glm::dvec3(1)))
        << s;
  }
}

TEST(Spz, AllSixteenSystemsAreTurned) {
  const GaussianCloud cloud = storable_cloud(50, 3);
  const GaussianCloud plain = parse(encode_spz(cloud, {.coordinate_system = 6})).cloud;
  const glm::dvec3 d = glm::normalize(glm::dvec3(1, -2, 4));
  for (std::size_t s = 0; s < systems.size(); ++s) {
    SCOPED_TRACE(systems[s]);
    const SpzStyle style{.coordinate_system = static_cast<std::uint32_t>(s + 1)};
    const GaussianCloud read = parse(encode_spz(cloud, style)).cloud;
    const auto turned = [s](const glm::dvec3& position) {
      return by_library(position, static_cast<std::uint32_t>(s + 1));
    };
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      EXPECT_LT(glm::distance(glm::dvec3(read.mean[i]), turned(glm::dvec3(plain.mean[i]))), 1e-6);
      EXPECT_NEAR(green(read, i, turned(d)), green(plain, i, d), 1e-5f);
      // The longest axis of a Gaussian, up to its sign.
      const auto axis = [i](const GaussianCloud& of) {
        glm::dvec3 along(0.0);
        const glm::vec3& scale = of.scale[i];
        along[scale.x > scale.y ? (scale.x > scale.z ? 0 : 2) : (scale.y > scale.z ? 1 : 2)] = 1.0;
        return glm::dquat(of.rotation[i]) * along;
      };
      EXPECT_NEAR(std::abs(glm::dot(axis(read), turned(axis(plain)))), 1.0, 1e-5);
    }
  }
}

TEST(Spz, ShOfDegreeFourIsCutToThree) {
  const GaussianCloud cloud = storable_cloud(300, 3);
  for (const int version : {3, 4})
    expect_near(cloud, parse(encode_spz(cloud, {.version = version, .extra_sh_degree = 4})).cloud,
                byte_steps);
  EXPECT_EQ(parse(encode_spz(cloud, {})).sh_degree, 3);
  EXPECT_EQ(parse(encode_spz(cloud, {.extra_sh_degree = 4})).sh_degree, 4);
}

TEST(Spz, CutOffFilesAreRefusedAtEveryLength) {
  const GaussianCloud cloud = storable_cloud(20, 1);
  for (const int version : {2, 4}) {
    const std::string bytes = encode_spz(cloud, {.version = version});
    for (std::size_t length = 2; length < bytes.size() - 8; ++length)  // gzip ends with a checksum
      EXPECT_EQ(refusal_of([&] { parse(bytes.substr(0, length)); }).source, "scene.spz")
          << "version " << version << " cut at byte " << length;
  }
}

TEST(Spz, LyingHeadersAreRefusedBeforeMemoryIsTaken) {
  const GaussianCloud cloud = storable_cloud(20, 0);
  const auto with = [&](int version, std::size_t at, const std::string& bytes) {
    std::string spz = encode_spz(cloud, {.version = 4});
    spz[4] = static_cast<char>(version);
    spz.replace(at, bytes.size(), bytes);
    return version < 4 ? gzip(spz) : spz;
  };
  struct Lie {
    int version;
    std::size_t at;
    std::string bytes;
    const char* where;
  };
  for (const Lie& lie : std::vector<Lie>{
           {4, 8, "\xff\xff\xff\x0f", "numPoints"},
           {3, 8, "\xff\xff\xff\x0f", "numPoints"},
           {3, 8, "\xff\xff\xff\xff", "numPoints"},
           {4, 8, std::string("\x15\0\0\0", 4), "size of the positions stream"},
           {4, 12, "\x05", "shDegree"},
           {4, 13, "\x20", "fractionalBits"},
           {4, 15, "\x07", "numStreams"},
           {4, 16, "\xff\xff\xff\x7f", "tocByteOffset"},
           {4, 32, "\xff\xff\xff\xff\xff\xff", "size of the positions stream"},
           {4, 0, "NGSX", "magic"},
           {4, 4, "\x09", "version"},
           {4, 4, "\x03", "version"},
       })
    EXPECT_EQ(refusal_of([&] { parse(with(lie.version, lie.at, lie.bytes)); }),
              (Refusal{"scene.spz", lie.where}))
        << lie.at;
}

TEST(Spz, HarmonicsCountInWhatAHeaderCanClaim) {
  // 65 bytes each: a claim that 20 bytes each would still allow.
  std::string spz = encode_spz(storable_cloud(2000, 3), {.version = 4});
  const auto claimed = static_cast<std::uint32_t>(spz.size() * max_compression / 40);
  ASSERT_GT(claimed, 1u << 16);
  std::memcpy(spz.data() + 8, &claimed, sizeof claimed);
  EXPECT_EQ(refusal_of([&] { parse(spz); }), (Refusal{"scene.spz", "numPoints"}));
}

TEST(Spz, DamagedStreamsNameTheByte) {
  std::string spz = encode_spz(storable_cloud(2000, 1), {.version = 3});
  for (std::size_t at = 200; at < 260; ++at) spz[at] = static_cast<char>(~spz[at]);
  EXPECT_THAT(refusal_of([&] { parse(spz); }).where, ::testing::StartsWith("byte "));
}

}  // namespace
}  // namespace catgs::test
