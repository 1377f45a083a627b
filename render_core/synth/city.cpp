#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "render_core/math/look_at.h"
#include "render_core/synth/backdrop.h"
#include "render_core/synth/city_parts.h"
#include "render_core/synth/city_plan.h"
#include "render_core/synth/plants.h"
#include "render_core/synth/scenes.h"

namespace catgs::synth {
namespace {

// Weights are numbers of Gaussians at full density. A city of at least this size has full density:
// a larger one extends farther and keeps the same Gaussians in its middle. A smaller one is both
// smaller and coarser.
constexpr std::size_t full_density_count = 1'000'000;

/// Gaussians of the sky, the hills and the skyline: a few thousand show them, more sharpen them.
std::size_t backdrop_count(std::size_t count) {
  return std::min<std::size_t>(count * 3 / 20, 4'500) +
         std::min(count, full_density_count) * 7 / 200;
}

struct Cell {
  int column;
  int row;
  float distance;  // from its middle to the city's centre
  double weight;
};

/// Everything of one cell of the plan: its block and the streets west and south of it.
void paint_cell(Painter& painter, const Block& block, float haze) {
  paint_streets(painter, block, haze);
  paint_lot(painter, block, haze);
  for (const Building& b : block.buildings)
    paint_building(painter, b, detail_at(b.base.middle()), haze);
  for (const Tree& tree : block.trees) {
    if (!painter.measuring()) {
      const float r = 1.6f * tree.crown;
      painter.shadows().focus({at(tree.position.x - r, tree.height + 2.0f * r, tree.position.y - r),
                               at(tree.position.x + r, 0, tree.position.y + r)});
    }
    Random random(tree.key);
    const glm::vec3 leaves = leaf_albedo(random);
    paint_tree(painter, at(tree.position.x, 0, tree.position.y), tree.height, tree.crown, leaves,
               haze, 110.0 * tree.crown * tree.crown * detail_at(tree.position), tree.key);
  }
  paint_props(painter, block, haze);
  const glm::vec2 corner = block.lot.min - 10.0f;
  paint_floaters(painter, at(corner.x, 26.0f, corner.y),
                 at(corner.x + block_pitch_m, 0.3f, corner.y + block_pitch_m),
                 0.015 * painter.measured(), child(block.key, 90));
}

double measure_cell(std::uint64_t seed, const Light& light, int column, int row) {
  Shadows none(light.to_sun());
  Painter painter(light, none);
  paint_cell(painter, plan_block(seed, column, row), 0.0f);
  return painter.measured();
}

/// Cells from the centre outwards until their weights reach `target`. Always includes those around
/// the first crossings.
std::vector<Cell> choose_cells(std::uint64_t seed, const Light& light, double target,
                               ThreadPool& pool) {
  std::vector<Cell> chosen;
  double sum = 0.0;
  float done = 0.0f;  // all cells nearer than this are chosen
  constexpr std::size_t fewest = 8;
  while (sum < target || chosen.size() < fewest) {
    const float ring = done + std::max(block_pitch_m, 0.5f * done);
    std::vector<Cell> cells;
    const int reach = static_cast<int>(ring / block_pitch_m) + 2;
    for (int column = -reach; column <= reach; ++column) {
      for (int row = -reach; row <= reach; ++row) {
        const glm::vec2 middle = (glm::vec2(column, row) + 0.5f) * block_pitch_m;
        const float distance = glm::length(middle - city_centre);
        if (distance >= done && distance < ring) cells.push_back({column, row, distance, 0.0});
      }
    }
    std::sort(cells.begin(), cells.end(), [](const Cell& a, const Cell& b) {
      return std::tie(a.distance, a.column, a.row) < std::tie(b.distance, b.column, b.row);
    });
    pool.parallel_for(cells.size(), [&](std::size_t i) {
      cells[i].weight = measure_cell(seed, light, cells[i].column, cells[i].row);
    });
    for (const Cell& cell : cells) {
      if (sum >= target && chosen.size() >= fewest) break;
      chosen.push_back(cell);
      sum += cell.weight;
    }
    done = ring;
  }
  return chosen;
}

/// A city as parts that can be painted one by one: its cells from the middle outwards, then the
/// backdrop.
class City {
 public:
  City(std::size_t count, std::uint64_t seed, ThreadPool& pool);

  [[nodiscard]] std::size_t parts() const { return cells_.size() + 1; }
  /// Gaussians of the parts before this one.
  [[nodiscard]] std::size_t first(std::size_t part) const {
    return part < parts() ? first_[part] : count_;
  }
  /// The Gaussians of the parts [begin, end), in parallel.
  [[nodiscard]] GaussianCloud paint(std::size_t begin, std::size_t end, ThreadPool& pool) const;
  [[nodiscard]] SceneHints hints() const;

 private:
  void paint_cell_at(std::size_t cell, GaussianCloud& cloud, std::size_t to) const;
  void paint_backdrop(GaussianCloud& cloud, std::size_t to) const;

  std::size_t count_;
  std::uint64_t seed_;
  Light light_;
  std::vector<Cell> cells_;
  std::vector<std::size_t> first_;  // by part
  float radius_;
};

City::City(std::size_t count, std::uint64_t seed, ThreadPool& pool)
    : count_(count),
      seed_(seed),
      light_(glm::normalize(glm::vec3(-0.88f, -0.41f, -0.20f)), child(seed, 1)) {
  const std::size_t reference = std::min(count, full_density_count);
  const std::size_t in_cells = count - backdrop_count(count);
  // Below full density, the area shrinks with the count to the power 3/4, the density by the rest.
  const double fill = std::sqrt(std::sqrt(static_cast<double>(reference) / full_density_count));
  const double target = static_cast<double>(in_cells) / fill;
  cells_ = choose_cells(seed, light_, target, pool);
  double total = 0.0;
  for (const Cell& cell : cells_) total += cell.weight;
  const double density = count < full_density_count ? static_cast<double>(in_cells) / total : 1.0;
  first_.assign(parts(), 0);
  double sum = 0.0;
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    sum += cells_[i].weight;
    first_[i + 1] = std::min(in_cells, static_cast<std::size_t>(sum * density));
  }
  first_.back() = in_cells;
  radius_ = cells_.back().distance + 0.5f * block_pitch_m;
}

GaussianCloud City::paint(std::size_t begin, std::size_t end, ThreadPool& pool) const {
  GaussianCloud cloud;
  cloud.resize(first(end) - first(begin), max_sh_degree);
  pool.parallel_for(end - begin, [&](std::size_t i) {
    const std::size_t part = begin + i, to = first(part) - first(begin);
    if (part < cells_.size())
      paint_cell_at(part, cloud, to);
    else
      paint_backdrop(cloud, to);
  });
  return cloud;
}

void City::paint_cell_at(std::size_t i, GaussianCloud& cloud, std::size_t to) const {
  Shadows shadows(light_.to_sun());
  const Cell& cell = cells_[i];
  for (int dc = -2; dc <= 1; ++dc) {  // the sun stands to the west and south
    for (int dr = -2; dr <= 1; ++dr)
      add_shadows(plan_block(seed_, cell.column + dc, cell.row + dr), shadows);
  }
  const glm::vec2 corner = glm::vec2(cell.column, cell.row) * block_pitch_m;
  shadows.keep({at(corner.x - 15.0f, 100.0f, corner.y - 15.0f),
                at(corner.x + block_pitch_m, 0.0f, corner.y + block_pitch_m)});
  const float haze = 0.30f * smooth_step(0.4f, 1.0f, cell.distance / std::max(radius_, 220.0f));
  Painter painter(light_, shadows, cloud, to, first(i + 1) - first(i), cell.weight);
  paint_cell(painter, plan_block(seed_, cell.column, cell.row), haze);
}

void City::paint_backdrop(GaussianCloud& cloud, std::size_t to) const {
  Shadows shadows(light_.to_sun());
  Painter painter(light_, shadows, cloud, to, count_ - first_.back(), 1.0);
  const std::size_t n = painter.take(1.0);
  painter.divide(n, [&](Painter& p) {
    const glm::vec2 centre = city_centre;
    const float sky = std::max(900.0f, 4.0f * radius_);
    paint_sky(p, centre, sky, 0.55, child(seed_, 2));
    // Begins within the outermost cells, whose ring has gaps.
    paint_horizon(p, centre, std::max(0.55f * radius_, radius_ - 1.2f * block_pitch_m), sky,
                  {0.22f, 0.21f, 0.17f}, 0.18, child(seed_, 3));
    paint_skyline(p, centre, radius_ + 40.0f, 2.2f * radius_ + 150.0f, 0.27, child(seed_, 4));
  });
}

SceneHints City::hints() const {
  SceneHints hints;
  hints.start_pose =
      look_at(at(start_position.x, 11.0f, start_position.y), at(-8.0f, 4.0f, 40.0f), up);
  hints.near_z = 0.2f;
  hints.scale = 14.0f;
  hints.limits = {at(city_centre.x - radius_, 90.0f, city_centre.y - radius_),
                  at(city_centre.x + radius_, 0.5f, city_centre.y + radius_)};
  // On the view axis, over the middle of the crossing: an orbit stays between the houses.
  hints.focus = at(-0.4f, 7.0f, -2.7f);
  hints.about.metres_per_unit = 1.0f;
  hints.source = "procedural";
  return hints;
}

}  // namespace

Scene make_city(std::size_t count, std::uint64_t seed, ThreadPool& pool) {
  const City city(count, seed, pool);
  Scene scene;
  scene.name = "city";
  scene.format = "procedural";
  scene.cloud = city.paint(0, city.parts(), pool);
  scene.hints = city.hints();
  return scene;
}

SceneHints stream_city(std::size_t count, std::uint64_t seed, ThreadPool& pool,
                       const std::function<void(const GaussianCloud&)>& take) {
  constexpr std::size_t at_a_time = 1'000'000;
  const City city(count, seed, pool);
  for (std::size_t begin = 0, end = 0; begin < city.parts(); begin = end) {
    while (end < city.parts() && city.first(end) - city.first(begin) < at_a_time) ++end;
    take(city.paint(begin, end, pool));
  }
  return city.hints();
}

}  // namespace catgs::synth
