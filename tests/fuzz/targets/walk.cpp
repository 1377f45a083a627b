#include <algorithm>
#include <cstdint>
#include <cstring>

#include "render_core/walk/walk_file.h"
#include "tests/fuzz/target.h"
#include "tests/render_core/walk/hand_made_map.h"
#include "tests/render_core/walk/seal.h"
#include "tests/support/walker.h"

namespace catgs::fuzz {
namespace {

void require_clear(const walk::WalkMap& map, const walk::Stand& stand) {
  require(map.clear_at(glm::ivec2(glm::floor(stand.position)), stand.height) != nullptr,
          "a walker stands on clear ground");
}

constexpr std::size_t length_bytes = 2;

/// An input is the header and then each tile as it is before it is packed, with its length before
/// it. Sizes and checksum are written here.
void parse_walk(Bytes input) {
  std::string header = text_of(input.first(std::min(input.size(), test::walk_header_bytes)));
  header.resize(test::walk_header_bytes);
  input = input.subspan(std::min(input.size(), header.size()));
  std::vector<std::string> tiles;
  while (input.size() >= length_bytes) {
    std::uint16_t length = 0;
    std::memcpy(&length, input.data(), length_bytes);
    input = input.subspan(length_bytes);
    const std::size_t bytes = std::min<std::size_t>(length, input.size());
    tiles.push_back(text_of(input.first(bytes)));
    input = input.subspan(bytes);
  }
  const std::string bytes = test::packed(header, tiles);
  const walk::WalkMap map =
      walk::read_walk_file(MemorySource("input", std::as_bytes(std::span(bytes))));
  walk::Stand at = map.start;
  for (const glm::vec2 way : {glm::vec2(3, 1), glm::vec2(-7, 2), glm::vec2(1, -9)}) {
    at = walk::move(map, at, way);
    require_clear(map, at);
  }
  for (const walk::Stand& turn : walk::find_path(map, map.start, at)) require_clear(map, turn);
  const std::string again = walk::pack(map);
  require(walk::read_walk_file(MemorySource("again", std::as_bytes(std::span(again)))).positions ==
              map.positions,
          "what is read can be written");
}

std::map<std::string, std::string> walk_seeds() {
  using walk::Kind;
  const auto seed = [](const walk::WalkMap& map) {
    std::string input = walk::pack(map).substr(0, test::walk_header_bytes);
    for (const std::string& tile : walk::tiles_of(map)) {
      const auto length = static_cast<std::uint16_t>(tile.size());
      input.append(reinterpret_cast<const char*>(&length), length_bytes).append(tile);
    }
    return input;
  };
  walk::WalkMap storeys = test::hand_made_map({4, 3}, [](int, int) { return Kind::clear; });
  storeys.positions.push_back({800, Kind::clear});
  ++storeys.first.back();
  storeys.storeys = {{0.0f, 10.0f, 12}, {40.0f, 50.0f, 1}};
  return {
      {"yard",
       seed(test::hand_made_map(
           {8, 5}, [](int x, int y) { return x == 5 && y < 3 ? Kind::obstacle : Kind::clear; }))},
      {"tiles", seed(test::hand_made_map(
                    {2, 130}, [](int, int y) { return y < 64 ? Kind::clear : Kind{9}; }))},
      {"storeys", seed(storeys)}};
}

}  // namespace

std::vector<Target> walk_targets() {
  return {{.name = "walk",
           .parse = parse_walk,
           .seeds = walk_seeds,
           .dictionary = {"catgswlk", std::string("\0\0\x80\x7f", 4), std::string("\1\0\0\0", 4),
                          std::string("\xff\xff\x7f", 3)},
           .max_bytes = 2048}};
}

}  // namespace catgs::fuzz
