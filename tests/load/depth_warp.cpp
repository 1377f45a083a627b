#include "tests/load/depth_warp.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <glm/common.hpp>
#include <glm/mat3x3.hpp>

namespace catgs::load {
namespace {

/// As in depth_mesh.ts: how far beyond the picture's middle its mesh reaches.
constexpr double mesh_reach = 4.0;

double mesh_place(int cell, int cells) {
  if (cell < 0) return -mesh_reach;
  return cell < cells ? (2.0 * cell + 1.0) / cells - 1.0 : mesh_reach;
}

/// What a view shows at each of its pixels.
struct Seen {
  std::vector<glm::dvec2> picture;
  std::vector<double> inverse_depth;  // of the view; less than 0: nothing
};

/// Draws a triangle by its homogeneous edges (Olano and Greer 1997), so that corners behind the
/// view's camera need no clipping.
void draw_triangle(const std::array<const MeshPoint*, 3>& corners, glm::ivec2 size_px, Seen& seen) {
  const glm::dmat3 m(corners[0]->view, corners[1]->view, corners[2]->view);
  if (std::abs(glm::determinant(m)) < 1e-18) return;  // seen from its edge
  const glm::dmat3 weights_of = glm::inverse(m);
  glm::dvec2 low(-1.0), high(1.0);
  if (std::ranges::all_of(corners, [](const MeshPoint* corner) { return corner->view.z > 1e-6; })) {
    low = glm::dvec2(1.0), high = glm::dvec2(-1.0);
    for (const MeshPoint* corner : corners) {
      const glm::dvec2 at = glm::dvec2(corner->view) / corner->view.z;
      low = glm::min(low, glm::max(at, -1.0)), high = glm::max(high, glm::min(at, 1.0));
    }
  }
  const glm::dvec2 size(size_px);
  const glm::ivec2 from = glm::max(glm::ivec2(glm::floor(0.5 * (low + 1.0) * size - 0.5)), 0);
  const glm::ivec2 to = glm::min(glm::ivec2(glm::ceil(0.5 * (high + 1.0) * size)), size_px);
  for (int y = from.y; y < to.y; ++y) {
    for (int x = from.x; x < to.x; ++x) {
      const glm::dvec2 at = (2.0 * glm::dvec2(x, y) + 1.0) / size - 1.0;
      const glm::dvec3 weights = weights_of * glm::dvec3(at, 1.0);  // over the view depth
      constexpr double slack = -1e-9;
      if (weights.x < slack || weights.y < slack || weights.z < slack) continue;
      double inverse_depth = 0.0;
      glm::dvec2 place(0.0);
      for (int i = 0; i < 3; ++i) {
        inverse_depth += weights[i] * corners[static_cast<std::size_t>(i)]->inverse_depth;
        place += weights[i] * corners[static_cast<std::size_t>(i)]->picture;
      }
      const auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(size_px.x) +
                         static_cast<std::size_t>(x);
      if (inverse_depth < seen.inverse_depth[pixel]) continue;
      seen.inverse_depth[pixel] = inverse_depth;
      seen.picture[pixel] = place / (weights.x + weights.y + weights.z);
    }
  }
}

}  // namespace

double median_distance(const Depths& depths) {
  std::vector<float> sorted = depths.inverse_depths;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::ranges::nth_element(sorted, middle);
  return 1.0 / *middle;
}

std::vector<MeshPoint> mesh_points(const Depths& depths, const Eye& picture, const Eye& view,
                                   double picture_aspect, double view_aspect) {
  constexpr double far_away = std::numeric_limits<double>::infinity();
  const glm::dmat3 far = warp_matrix(view, picture, view_aspect, picture_aspect, far_away);
  const glm::dvec3 shift = warp_matrix(view, picture, view_aspect, picture_aspect, 1.0)[2] - far[2];
  const glm::ivec2 cells = depths.cells;
  std::vector<MeshPoint> points;
  for (int row = -1; row <= cells.y; ++row) {
    for (int column = -1; column <= cells.x; ++column) {
      const glm::ivec2 cell = glm::clamp(glm::ivec2(column, row), glm::ivec2(0), cells - 1);
      MeshPoint point;
      point.picture = {mesh_place(column, cells.x), mesh_place(row, cells.y)};
      point.inverse_depth =
          depths.inverse_depths[static_cast<std::size_t>(cell.y * cells.x + cell.x)];
      point.view = far * glm::dvec3(point.picture, 1.0) + point.inverse_depth * shift;
      points.push_back(point);
    }
  }
  return points;
}

Image warp_by_depths(const Image& picture, const Depths& depths, const Eye& picture_eye,
                     const Eye& view, double view_aspect, glm::ivec2 size_px) {
  const double picture_aspect = static_cast<double>(picture.size_px.x) / picture.size_px.y;
  const std::vector<MeshPoint> points =
      mesh_points(depths, picture_eye, view, picture_aspect, view_aspect);
  const std::size_t pixels =
      static_cast<std::size_t>(size_px.x) * static_cast<std::size_t>(size_px.y);
  Seen seen{std::vector<glm::dvec2>(pixels), std::vector<double>(pixels, -1.0)};
  const auto stride = static_cast<std::size_t>(depths.cells.x) + 2;
  for (std::size_t at = 0; at + stride + 1 < points.size(); ++at) {
    if (at % stride == stride - 1) continue;
    const MeshPoint *a = &points[at], *b = a + 1, *c = a + stride, *d = c + 1;
    draw_triangle({a, b, c}, size_px, seen);
    draw_triangle({b, d, c}, size_px, seen);
  }
  Image image{size_px, {}};
  image.rgb.reserve(3 * pixels);
  for (std::size_t i = 0; i < pixels; ++i) append_sample(picture, seen.picture[i], image);
  return image;
}

}  // namespace catgs::load
