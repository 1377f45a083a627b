// The pixels of each tile of a turned grid, against list_from_frame in double precision for every
// pixel.

#include "render_core/cuda/pixel_runs.cuh"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

class PixelRunStage : public StageTest {};

TEST_F(PixelRunStage, EveryPixelIsInTheTileThatHoldsItOnce) {
  const Camera key = make_camera({}, {325, 187}, 300.0f);
  const TileGrid grid = covering_grid({-60.0, -50.0}, {390.0, 240.0});
  for (const glm::vec3 turn :
       {glm::vec3(0.0f), glm::vec3(0.02f, -0.05f, 0.0f), glm::vec3(0.01f, 0.03f, 0.12f)}) {
    const Homography<double> list_from_frame = image_turn(key, {{}, glm::quat(turn)});
    FrameShape shape = picture_shape(key.size_px, grid);
    shape.tile_parts = most_run_parts;
    const std::uint32_t room = run_bound_px(shape);
    const auto pixels = upload(std::vector<PixelPlace>(std::size_t{shape.tiles()} * room));
    const auto pixel_count = upload(std::vector<std::uint32_t>(shape.tiles()));
    const Stream stream;
    launch_pixel_runs({.shape = shape,
                       .list_from_frame = math::convert<float>(list_from_frame),
                       .frame_from_list = math::convert<float>(math::inverse(list_from_frame)),
                       .pixels = pixels.get(),
                       .pixel_count = pixel_count.get()},
                      stream.get());
    const auto places = fetch(pixels.get(), std::size_t{shape.tiles()} * room);
    const auto counts = fetch(pixel_count.get(), shape.tiles());

    std::vector<int> seen(static_cast<std::size_t>(key.size_px.x * key.size_px.y));
    Difference outside("pixel runs: px that a pixel lies outside of its tile", 1e-3);
    Difference spread("pixel runs: mean extent of 64 neighbours in a run, px", 14.0);
    double extents = 0.0;
    int parts = 0;
    for (std::uint32_t t = 0; t < shape.tiles(); ++t) {
      const glm::dvec2 low =
          glm::dvec2(grid.first_px) +
          16.0 * glm::dvec2(static_cast<int>(t) % grid.tiles.x, static_cast<int>(t) / grid.tiles.x);
      glm::ivec2 least(key.size_px), most(0);
      for (std::uint32_t k = 0; k < counts[t]; ++k) {
        const PixelPlace& place = places[std::size_t{t} * room + k];
        ++seen[static_cast<std::size_t>(place.y * key.size_px.x + place.x)];
        const auto at = math::apply<double>(list_from_frame, {place.x + 0.5, place.y + 0.5});
        outside.add(
            std::max({low.x - at.x, at.x - low.x - 16.0, low.y - at.y, at.y - low.y - 16.0, 0.0}));
        least = glm::min(least, glm::ivec2(place.x, place.y));
        most = glm::max(most, glm::ivec2(place.x, place.y));
        if (k % part_pixels + 1 != part_pixels) continue;
        extents += 0.5 * static_cast<double>(most.x - least.x + most.y - least.y + 2);
        ++parts;
        least = key.size_px;
        most = glm::ivec2(0);
      }
    }
    spread.add(extents / parts);
    Mismatches once("pixel runs: pixels that are not in one run", 0.0);
    for (const int times : seen) once.add(times != 1);
  }
}

}  // namespace
}  // namespace catgs::cuda::stages
