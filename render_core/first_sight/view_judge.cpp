#include "render_core/first_sight/view_judge.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/first_sight/lens.h"
#include "render_core/scene/activations.h"

namespace catgs::first_sight {
namespace {

constexpr std::size_t sample_size = std::size_t{1} << 18;

/// The few Gaussians of a sky, which are as large as all others together, count as large ones of
/// the core.
float largest_area(const Bounds& core) {
  return 1e-4f * glm::dot(core.max - core.min, core.max - core.min);
}

/// The area that a Gaussian covers from its broad side.
std::vector<float> weights_of(const GaussianCloud& cloud, float largest) {
  std::vector<float> weights(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const glm::vec3& s = cloud.scale[i];
    const float area = std::max({s.x * s.y, s.y * s.z, s.z * s.x});
    weights[i] = cloud.opacity[i] * std::min(area, largest) + std::numeric_limits<float>::min();
  }
  return weights;
}

/// Appends a Gaussian that is `growth` times as large. Its colour becomes (luminance, 1, red -
/// blue): the middle channel of a picture is its coverage.
void append(const GaussianCloud& from, std::size_t i, float growth, GaussianCloud& to) {
  to.mean.push_back(from.mean[i]);
  to.rotation.push_back(from.rotation[i]);
  to.scale.push_back(growth * from.scale[i]);
  to.opacity.push_back(from.opacity[i]);
  const glm::vec3 colour = glm::clamp(0.5f + sh_c0 * from.sh_of(i)[0], 0.0f, 1.0f);
  const float luminance = glm::dot(colour, glm::vec3(0.2126f, 0.7152f, 0.0722f));  // BT.709
  const glm::vec3 seen(luminance, 1.0f, 0.5f + 0.5f * (colour.r - colour.b));
  to.sh.push_back((seen - 0.5f) / sh_c0);
}

/// A sample with a chance in proportion to the weights, evenly spread over the order of the scene
/// (systematic sampling, Madow 1949). Those that stand for others grow, so that the area is kept,
/// but not beyond the largest ones: these would fill free space.
GaussianCloud sample(const GaussianCloud& cloud, const Bounds& core, float stands_for) {
  GaussianCloud small;
  small.model = cloud.model;
  if (cloud.size() <= sample_size && stands_for == 1.0f) {
    for (std::size_t i = 0; i < cloud.size(); ++i) append(cloud, i, 1.0f, small);
    return small;
  }
  const float largest = largest_area(core);
  const std::vector<float> weights = weights_of(cloud, largest);
  const double step = std::accumulate(weights.begin(), weights.end(), 0.0) / sample_size;
  double left = 0.5 * step;  // to the next one that is taken
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    left -= static_cast<double>(weights[i]);
    if (left > 0.0) continue;
    left += step * (std::floor(-left / step) + 1.0);
    const float grown = stands_for * std::max(1.0f, static_cast<float>(step) / weights[i]);
    const float allowed = cloud.opacity[i] * largest / weights[i];
    append(cloud, i, std::sqrt(std::max(1.0f, std::min(grown, allowed))), small);
  }
  return small;
}

/// Difference of neighbouring pixels, but none at the outline: every side has one.
float difference(const glm::vec3& a, const glm::vec3& b) {
  constexpr float covered = 0.9f;
  return std::min(a.y, b.y) < covered ? 0.0f : std::abs(a.x - b.x) + std::abs(a.z - b.z);
}

/// Detail of the square blocks of a picture, each the mean over its pixels.
std::vector<float> detail_of(const std::vector<glm::vec3>& picture) {
  constexpr int side = 12, columns = width_px / side, rows = height_px / side;
  std::vector<float> blocks(static_cast<std::size_t>(columns) * rows);
  for (int y = 1; y < height_px; ++y)
    for (int x = 1; x < width_px; ++x) {
      const auto i = static_cast<std::size_t>(y * width_px + x);
      const float here =
          difference(picture[i], picture[i - 1]) + difference(picture[i], picture[i - width_px]);
      blocks[static_cast<std::size_t>(y / side * columns + x / side)] += here / (side * side);
    }
  return blocks;
}

float symmetry_of(const std::vector<glm::vec3>& picture) {
  float mirrored = 0.0f, light = 1e-6f;
  for (int y = 0; y < height_px; ++y)
    for (int x = 0; x < width_px / 2; ++x) {
      const auto row = static_cast<std::size_t>(y * width_px);
      const float left = picture[row + static_cast<std::size_t>(x)].x;
      const float right = picture[row + static_cast<std::size_t>(width_px - 1 - x)].x;
      mirrored += std::abs(left - right);
      light += left + right;
    }
  return 1.0f - mirrored / light;
}

}  // namespace

ViewJudge::ViewJudge(const GaussianCloud& cloud, float stands_for, const Bounds& core,
                     std::shared_ptr<ThreadPool> pool)
    : renderer_(make_renderer(std::make_shared<GaussianCloud>(sample(cloud, core, stands_for)),
                              {.kind = RendererKind::cpu, .pool = std::move(pool)})
                    .renderer),
      view_(renderer_->make_view({})),
      picture_(width_px * height_px),
      without_near_(width_px * height_px) {}

void ViewJudge::draw(const Pose& pose, float near_z, std::vector<glm::vec3>& pixels) {
  constexpr float focal_px = 0.5f * height_px / half_height;
  FrameView frame;
  const RenderStatus status =
      view_->render({.camera = make_camera(pose, {width_px, height_px}, focal_px, near_z)}, frame);
  if (!status.ok()) throw std::runtime_error(status.message);
  const auto& [data, stride_bytes] = frame.planes[0];
  for (std::size_t row = 0; row < height_px; ++row)
    std::memcpy(&pixels[row * width_px], data + row * stride_bytes, width_px * sizeof(glm::vec3));
}

Judgement ViewJudge::judge(const Pose& pose, float near,
                           const std::function<bool(const Judgement& unveiled)>& wanted) {
  const auto pixels = static_cast<float>(picture_.size());
  draw(pose, 0.01f * near, picture_);
  Judgement seen{.symmetry = symmetry_of(picture_)};
  for (const glm::vec3& pixel : picture_) seen.coverage += pixel.y / pixels;
  const std::vector<float> blocks = detail_of(picture_);
  for (const float block : blocks) {
    seen.detail += block / static_cast<float>(blocks.size());
    seen.spread += std::sqrt(block) / static_cast<float>(blocks.size());
  }
  if (!wanted(seen)) {
    seen.veil = 1.0f;
    return seen;
  }
  draw(pose, near, without_near_);
  for (std::size_t i = 0; i < picture_.size(); ++i) {
    const glm::vec3 change = glm::abs(picture_[i] - without_near_[i]);
    seen.veil += std::min(1.0f, 2.0f * std::max({change.x, change.y, change.z})) / pixels;
  }
  return seen;
}

}  // namespace catgs::first_sight
