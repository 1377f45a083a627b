#include "render_core/tools/paper/work_count.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "render_core/math/blend-inl.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/projection-inl.h"

namespace catgs {
namespace {

constexpr glm::ivec2 box_px{8, 4};

/// A Gaussian in the image plane, without its colour.
struct Splat {
  float depth = 0.0f;
  math::Vec2<float> centre_px{};
  math::Ellipse<float> ellipse{};
  float log2_opacity = 0.0f;
  int first_row = 0, last_row = 0;  // of tiles that its box meets
};

math::Vec3<double> to_vec3(const glm::vec3& v) { return {v.x, v.y, v.z}; }

/// Projects Gaussian i, if any tile may see it.
bool project(const GaussianCloud& cloud, std::size_t i, const math::CameraModel<double>& camera,
             int tile_rows, Splat& splat) {
  const math::Vec3<double> mean = to_vec3(cloud.mean[i]);
  const double depth = math::view_depth(camera, mean);
  const double log2_opacity = std::log2(static_cast<double>(cloud.opacity[i]));
  const double reach = math::reach_of(log2_opacity);
  if (!(depth > camera.near_z) || !(reach >= 0.0)) return false;
  const glm::quat& q = cloud.rotation[i];
  const double rotation[4] = {q.x, q.y, q.z, q.w};
  const auto factor = math::covariance_factor(rotation, to_vec3(cloud.scale[i]));
  const auto projected = math::project(camera, mean, factor, depth);
  const auto whitening = math::whitening(projected);
  const auto half = math::half_extent(projected, reach);
  const double top = (projected.centre_px.y - half.y) / tile_size_px;
  const double bottom = (projected.centre_px.y + half.y) / tile_size_px;
  if (!(bottom >= 0.0 && top < tile_rows)) return false;
  splat.depth = static_cast<float>(depth);
  splat.centre_px = math::convert<float>(projected.centre_px);
  splat.ellipse = math::convert<float>(
      math::make_ellipse(whitening, reach, half.x, math::rightmost_y(whitening, reach)));
  splat.log2_opacity = static_cast<float>(log2_opacity);
  splat.first_row = static_cast<int>(std::max(top, 0.0));
  splat.last_row = static_cast<int>(std::min<double>(bottom, tile_rows - 1));
  return true;
}

/// Sorted front to back.
std::vector<Splat> project_all(const GaussianCloud& cloud, const Camera& camera, int tile_rows,
                               ThreadPool& pool) {
  constexpr std::size_t chunk = 16384;
  const math::CameraModel<double> model = math::make_camera_model(camera);
  std::vector<std::vector<Splat>> parts((cloud.size() + chunk - 1) / chunk);
  pool.parallel_for(parts.size(), [&](std::size_t part) {
    const std::size_t end = std::min(cloud.size(), (part + 1) * chunk);
    for (std::size_t i = part * chunk; i < end; ++i) {
      if (Splat splat; project(cloud, i, model, tile_rows, splat)) parts[part].push_back(splat);
    }
  });
  std::vector<Splat> splats;
  for (const std::vector<Splat>& part : parts) {
    splats.insert(splats.end(), part.begin(), part.end());
  }
  std::ranges::stable_sort(splats, {}, &Splat::depth);
  return splats;
}

/// Columns of the image, in pixels, that a splat covers in pixel rows `first` to `last`.
math::Interval<float> columns(const Splat& splat, int first, int last) {
  const float first_y = static_cast<float>(first) + 0.5f - splat.centre_px.y;
  const float last_y = static_cast<float>(last) + 0.5f - splat.centre_px.y;
  const auto cut = math::columns_in_band(splat.ellipse, first_y, last_y);
  return {cut.low + splat.centre_px.x, cut.high + splat.centre_px.x};
}

/// Pixels of one box while its tile's list is blended.
class Box {
 public:
  Box(glm::ivec2 first_px, glm::ivec2 size_px) : first_px_(first_px) {
    for (int y = first_px.y; y < std::min(first_px.y + box_px.y, size_px.y); ++y) {
      for (int x = first_px.x; x < std::min(first_px.x + box_px.x, size_px.x); ++x) {
        pixels_[live_++] = {{static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f},
                            math::empty_pixel<float>()};
      }
    }
  }

  [[nodiscard]] bool finished() const { return live_ == 0; }

  [[nodiscard]] bool meets(const Splat& splat) const {
    const auto covered = columns(splat, first_px_.y, first_px_.y + box_px.y - 1);
    const auto left = static_cast<float>(first_px_.x);
    return covered.low <= covered.high && covered.high >= left + 0.5f &&
           covered.low <= left + static_cast<float>(box_px.x) - 0.5f;
  }

  /// Returns the number of pixels that the splat was blended into.
  int blend(const Splat& splat) {
    int blended = 0, kept = 0;
    for (int i = 0; i < live_; ++i) {
      Pixel& pixel = pixels_[i];
      const math::Vec2<float> d{pixel.place.x - splat.centre_px.x,
                                pixel.place.y - splat.centre_px.y};
      const float exponent = splat.log2_opacity - math::whitened_square(splat.ellipse.w, d);
      const bool live = math::blend(pixel.state, exponent, {0.0f, 0.0f, 0.0f});
      blended += live && math::contributes(exponent) ? 1 : 0;
      if (live) pixels_[kept++] = pixel;
    }
    live_ = kept;
    return blended;
  }

 private:
  struct Pixel {
    math::Vec2<float> place;
    math::PixelState<float> state;
  };
  glm::ivec2 first_px_;
  Pixel pixels_[box_px.x * box_px.y];
  int live_ = 0;
};

void blend_tile(const std::vector<const Splat*>& list, glm::ivec2 tile, glm::ivec2 size_px,
                WorkCount& count) {
  std::vector<Box> boxes;
  for (int y = 0; y < tile_size_px; y += box_px.y) {
    for (int x = 0; x < tile_size_px; x += box_px.x) {
      const Box box(tile * tile_size_px + glm::ivec2(x, y), size_px);
      if (!box.finished()) boxes.push_back(box);
    }
  }
  for (const Splat* splat : list) {
    if (boxes.empty()) break;
    ++count.reached_entries;
    for (Box& box : boxes) {
      if (!box.meets(*splat)) continue;
      ++count.warp_evaluations;
      count.blended_pairs += static_cast<std::uint64_t>(box.blend(*splat));
    }
    std::erase_if(boxes, [](const Box& box) { return box.finished(); });
  }
}

/// Lists and blends one row of tiles.
WorkCount count_row(const std::vector<Splat>& splats, int row, glm::ivec2 size_px,
                    int tile_columns) {
  std::vector<std::vector<const Splat*>> lists(static_cast<std::size_t>(tile_columns));
  const int first_px = row * tile_size_px;
  const int last_px = std::min(first_px + tile_size_px, size_px.y) - 1;
  const float right_px = static_cast<float>(size_px.x) - 0.5f;
  for (const Splat& splat : splats) {
    if (row < splat.first_row || row > splat.last_row) continue;
    const auto covered = columns(splat, first_px, last_px);
    const float low = std::max(covered.low, 0.5f);
    const float high = std::min(covered.high, right_px);
    if (!(covered.low <= covered.high && low <= high)) continue;
    const int first = std::max(0, static_cast<int>(std::ceil((low - 15.5f) / tile_size_px)));
    const int last = static_cast<int>(std::floor((high - 0.5f) / tile_size_px));
    for (int t = first; t <= last; ++t) lists[static_cast<std::size_t>(t)].push_back(&splat);
  }
  WorkCount count;
  for (int t = 0; t < tile_columns; ++t) {
    const auto& list = lists[static_cast<std::size_t>(t)];
    count.list_entries += list.size();
    blend_tile(list, {t, row}, size_px, count);
  }
  return count;
}

}  // namespace

WorkCount count_work(const GaussianCloud& cloud, const Camera& camera, ThreadPool& pool) {
  const glm::ivec2 tiles = (camera.size_px + (tile_size_px - 1)) / tile_size_px;
  const auto rows = static_cast<std::size_t>(tiles.y);
  const std::vector<Splat> splats = project_all(cloud, camera, tiles.y, pool);
  std::vector<WorkCount> counts(rows);
  pool.parallel_for(rows, [&](std::size_t row) {
    counts[row] = count_row(splats, static_cast<int>(row), camera.size_px, tiles.x);
  });
  WorkCount sum;
  for (const WorkCount& count : counts) {
    sum.list_entries += count.list_entries;
    sum.reached_entries += count.reached_entries;
    sum.warp_evaluations += count.warp_evaluations;
    sum.blended_pairs += count.blended_pairs;
  }
  return sum;
}

}  // namespace catgs
