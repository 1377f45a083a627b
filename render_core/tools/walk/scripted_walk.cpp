#include "render_core/tools/walk/scripted_walk.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/base/portable.h"

namespace catgs {
namespace {

using walk::Kind;
using walk::Person;
using walk::Stand;
using walk::WalkMap;

constexpr float samples_per_s = 30.0f;
constexpr float stride = 0.9f * walk::cells_per_eye_height / samples_per_s;  // cells

class Walker {
 public:
  Walker(const WalkMap& map, double seconds, std::uint64_t seed)
      : map_(map),
        random_(seed),
        samples_(static_cast<std::size_t>(seconds * static_cast<double>(samples_per_s))) {
    walk_.stands.push_back(map.start);
  }

  ScriptedWalk walk() {
    while (walk_.stands.size() < samples_) {
      go_to(random_place());
      stray();
    }
    return std::move(walk_);
  }

 private:
  [[nodiscard]] const Stand& here() const { return walk_.stands.back(); }
  float uniform() { return static_cast<float>(random_.next() >> 40) * 0x1p-24f; }

  void step(const glm::vec2& way) { walk_.stands.push_back(walk::move(map_, here(), way)); }

  Stand random_place() {
    constexpr float near = 50.0f * walk::cells_per_eye_height;
    Stand place = here();
    for (int attempt = 0; attempt < 4096; ++attempt) {
      const std::size_t i = random_.next() % map_.places.size();
      if (map_.places[i].kind != Kind::clear) continue;
      const auto column = static_cast<int>(
          std::distance(map_.first.begin(), std::ranges::upper_bound(map_.first, i)) - 1);
      place = {glm::vec2(column % map_.size.x, column / map_.size.x) + 0.5f,
               map_.places[i].cells()};
      if (glm::distance(place.place, here().place) < near) break;
    }
    return place;
  }

  void go_to(const Stand& goal) {
    ++walk_.goals;
    const std::vector<Stand> path = walk::find_path(map_, here(), goal);
    for (std::size_t k = 1; k < path.size(); ++k) {
      float left = glm::distance(path[k].place, here().place);
      while (left > 1e-3f && walk_.stands.size() < samples_) {
        step((path[k].place - here().place) * std::min(1.0f, stride / left));
        const float before = std::exchange(left, glm::distance(path[k].place, here().place));
        if (left >= before) return;  // something is in the way, where nothing should be
      }
    }
    const bool in_time = walk_.stands.size() < samples_;
    if (!in_time) --walk_.goals;
    walk_.reached += in_time && !path.empty();
  }

  void stray() {
    const float angle = 6.2831853f * uniform();
    const glm::vec2 way = stride * glm::vec2(std::cos(angle), std::sin(angle));
    for (int k = 0; k < static_cast<int>(3.0f * samples_per_s); ++k)
      if (walk_.stands.size() < samples_) step(way);
  }

  const WalkMap& map_;
  SplitMix64 random_;
  std::size_t samples_;
  ScriptedWalk walk_;
};

}  // namespace

ScriptedWalk scripted_walk(const WalkMap& map, double seconds, std::uint64_t seed) {
  return Walker(map, seconds, seed).walk();
}

WalkCheck check_walk(const WalkMap& map, const ScriptedWalk& walk, const SightLines& lines,
                     ThreadPool& pool) {
  constexpr float piece = 3.0f, apart = 1.0f, half = 0.5f, nearly_all = 0.9f;
  constexpr std::size_t most_faults = 16;
  WalkCheck check;
  std::vector<float> along = {0.0f};
  for (std::size_t k = 1; k < walk.stands.size(); ++k) {
    const Stand &a = walk.stands[k - 1], &b = walk.stands[k];
    along.push_back(along.back() + glm::distance(a.place, b.place));
    check.climbed += std::max(b.height - a.height, 0.0f);
    check.largest_drop = std::max(check.largest_drop, a.height - b.height);
  }
  check.length = along.back();
  struct Piece {
    glm::vec3 from, to, below;  // world
    float light = 1.0f, light_below = 0.0f;
  };
  std::vector<Piece> pieces;
  const auto at = [&](const Stand& s, float above) {
    return map.grid.to_world(glm::vec3(s.place, s.height + above));
  };
  const float chest = Person::in_cells(map.person.chest);
  for (float from = 0.0f; from + piece < check.length; from += apart) {
    const auto index = [&](float length) {
      return static_cast<std::size_t>(
          std::distance(along.begin(), std::ranges::lower_bound(along, length)));
    };
    const Stand &a = walk.stands[index(from)], &b = walk.stands[index(from + piece)];
    pieces.push_back({at(a, chest), at(b, chest), at(a, -Person::in_cells(map.person.step))});
  }
  pool.parallel_for(pieces.size(), [&](std::size_t k) {
    pieces[k].light = lines.light_between(pieces[k].from, pieces[k].to);
    pieces[k].light_below = lines.light_between(pieces[k].from, pieces[k].below);
  });
  check.pieces = pieces.size();
  for (const Piece& p : pieces) {
    check.blocked += p.light < half;
    check.least_light = std::min(check.least_light, p.light);
    check.unsupported += p.light_below > nearly_all;
    check.most_light_below = std::max(check.most_light_below, p.light_below);
    if ((p.light < half || p.light_below > nearly_all) && check.faults.size() < most_faults)
      check.faults.push_back(p.from);
  }
  return check;
}

}  // namespace catgs
