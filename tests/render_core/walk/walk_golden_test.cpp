// The walk that the web client repeats: tests/support/walk_golden.json has a map, moves over it and
// shortest paths. tests/web_client/walker.test.ts reads the same file.
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/base/portable.h"
#include "render_core/walk/walk_file.h"
#include "tests/render_core/walk/worlds.h"
#include "tests/support/walker.h"

namespace catgs::walk {
namespace {

using nlohmann::json;

std::string hex(std::string_view bytes) {
  std::string text;
  for (const char byte : bytes) text += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  return text;
}

json of(const Stand& at) { return {at.position.x, at.position.y, at.height}; }

/// Stairs up to a floor, beside a wall with a gap.
WalkMap map() {
  GaussianCloud cloud = test::stairs();
  test::add_plate(cloud, {0, 2, 0}, {0, 4, 0}, {0, 0, 2.2f});
  test::add_plate(cloud, {8, 1, 2.72f}, {0, 3, 0}, {0, 0, 2.2f});
  return test::map_of(cloud, {-1, 1, 1.6f});
}

float length_of(const std::vector<Stand>& path) {
  float length = 0.0f;
  for (std::size_t k = 1; k < path.size(); ++k)
    length += glm::distance(path[k - 1].position, path[k].position);
  return length;
}

json walked() {
  const WalkMap ground = map();
  json golden = {{"file", hex(pack(ground))}};
  SplitMix64 random(1);
  const auto part = [&](float size) {
    return size * (static_cast<float>(random.next() >> 40) * 0x1p-23f - 1.0f);
  };
  std::vector<Stand> ends = {ground.start};
  for (int leg = 0; leg < 12; ++leg) {
    const glm::vec2 way(leg % 2 == 0 ? 4.0f : part(4.0f), part(4.0f));
    for (int k = 0; k < 12; ++k) {
      const Stand from = ends.back(), to = move(ground, from, way);
      golden["moves"].push_back({{"from", of(from)}, {"way", {way.x, way.y}}, {"to", of(to)}});
      ends.push_back(to);
    }
  }
  const auto upstairs = stand_below(ground, {9, 5, 4});
  ends.push_back(upstairs.value());
  for (std::size_t k = 0; k + 1 < ends.size(); k += 12)
    golden["paths"].push_back({{"from", of(ends[k])},
                               {"to", of(ends.back())},
                               {"length", length_of(find_path(ground, ends[k], ends.back()))}});
  for (const glm::vec3 position : {glm::vec3(-1, 1, 5), glm::vec3(9, 5, 4), glm::vec3(9, 5, 2)})
    if (const auto stand = stand_below(ground, position)) {
      const glm::vec3 eyes = eyes_of(ground, *stand);
      golden["below"].push_back({{"place", {position.x, position.y, position.z}},
                                 {"stand", of(*stand)},
                                 {"eyes", {eyes.x, eyes.y, eyes.z}}});
    }
  return golden;
}

void expect_near(const json& now, const json& golden, const std::string& where) {
  ASSERT_EQ(now.is_structured(), golden.is_structured()) << where;
  ASSERT_EQ(now.size(), golden.size()) << where;
  if (now.is_number())
    EXPECT_NEAR(now.get<double>(), golden.get<double>(), 1e-4) << where;
  else if (!now.is_structured())
    EXPECT_EQ(now, golden) << where;
  else
    for (const auto& [key, value] : now.items())
      expect_near(value, now.is_array() ? golden.at(std::stoul(key)) : golden.at(key),
                  where + "/" + key);
}

/// Where the map or the walker changes on purpose, the file that the failure names replaces the
/// golden one.
TEST(WalkGolden, IsWhatTheWalkerDoes) {
  const json now = walked();
  EXPECT_GT(now.at("paths").size(), 10u);
  std::ifstream in(CATGS_WALK_GOLDEN);
  const json golden = json::parse(in, nullptr, false);
  expect_near(now, golden, "");
  if (!HasFailure()) return;
  const std::string path = testing::TempDir() + "walk_golden.json";
  std::ofstream(path) << now.dump() << "\n";
  ADD_FAILURE() << "the present walk is in " << path;
}

}  // namespace
}  // namespace catgs::walk
