#include "render_core/tools/walk/plan_files.h"

#include <fmt/format.h>

#include "render_core/image/png.h"
#include "render_core/walk/plan.h"

namespace catgs {

void print_map(const walk::WalkMap& map, std::uint64_t bytes) {
  const glm::vec2 size = glm::vec2(map.size) * map.grid.cell;
  fmt::print("{:.1f} x {:.1f} units, {} x {} columns, {} places, {:.1f} kB; north is {}\n", size.x,
             size.y, map.size.x, map.size.y, map.places.size(), 1e-3 * static_cast<double>(bytes),
             walk::north_of(map.grid));
  for (std::size_t k = 0; k < map.storeys.size(); ++k) {
    const walk::Storey& storey = map.storeys[k];
    fmt::print("storey {}: {:.2f} eye heights above the start's ground, {:.1f} square units\n", k,
               (storey.level - map.start.height) / walk::cells_per_eye_height,
               static_cast<float>(storey.area) * map.grid.cell * map.grid.cell);
  }
}

void write_plans(const walk::WalkMap& map, const std::filesystem::path& out) {
  for (std::size_t k = 0; k < map.storeys.size(); ++k) {
    std::filesystem::path path = out;
    if (map.storeys.size() > 1)
      path.replace_filename(
          fmt::format("{}-{}{}", out.stem().string(), k, out.extension().string()));
    write_png(path, walk::draw_plan(map, k));
    fmt::print("{}: plan of storey {}, {} is up\n", path.string(), k, walk::north_of(map.grid));
  }
}

}  // namespace catgs
