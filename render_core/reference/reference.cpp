#include "render_core/reference/reference.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include <glm/common.hpp>

#include "render_core/base/error.h"
#include "render_core/image/host_image.h"
#include "render_core/math/blend-inl.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/colour-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/projection-inl.h"
#include "render_core/math/spherical_harmonics-inl.h"
#include "render_core/scene/clusters.h"

namespace catgs {
namespace {

/// A Gaussian in the image plane.
struct ReferenceSplat {
  float depth;  // decides the order: rounded to float as in every core
  math::Vec2<double> centre_px;
  math::Whitening<double> whitening;
  double log2_opacity;
  double reach;
  math::Vec3<double> colour;
};

math::Vec3<double> to_vec3(const glm::vec3& v) { return {v.x, v.y, v.z}; }

math::Vec3<double> shade(const GaussianCloud& cloud, std::size_t i, const math::Vec3<double>& eye) {
  double basis[16];
  math::sh_basis(math::view_direction(eye, to_vec3(cloud.mean[i])), cloud.sh_degree, basis);
  glm::dvec3 sum(0.0);
  for (int k = 0; k < cloud.sh_count(); ++k) sum += basis[k] * glm::dvec3(cloud.sh_of(i)[k]);
  return {math::colour_from_sh_sum(sum.x), math::colour_from_sh_sum(sum.y),
          math::colour_from_sh_sum(sum.z)};
}

/// Every Gaussian in front of the near plane that can reach alpha_min, front to back; equal depths
/// keep the order of the scene's clusters.
std::vector<ReferenceSplat> project_all(const GaussianCloud& cloud, const Camera& request_camera,
                                        ThreadPool& pool) {
  const auto camera = math::make_camera_model(request_camera);
  std::vector<ReferenceSplat> splats;
  for (const std::uint32_t i : morton_order(cloud.mean, pool)) {
    const auto mean = to_vec3(cloud.mean[i]);
    const double depth = math::view_depth(camera, mean);
    ReferenceSplat splat;
    splat.depth = static_cast<float>(depth);
    if (!(splat.depth > request_camera.near_z) || !math::is_kept(camera, mean)) continue;
    const glm::quat& q = cloud.rotation[i];
    const double rotation[4] = {q.x, q.y, q.z, q.w};
    const auto factor = math::covariance_factor(rotation, to_vec3(cloud.scale[i]));
    const auto projected = math::project(camera, mean, factor, depth);
    splat.log2_opacity = std::log2(static_cast<double>(cloud.opacity[i]));
    if (cloud.model == SplatModel::antialiased)
      splat.log2_opacity = math::antialiased_log2_opacity(splat.log2_opacity, projected);
    splat.reach = math::reach_of(splat.log2_opacity);
    if (!(splat.reach >= 0.0)) continue;
    splat.centre_px = projected.centre_px;
    splat.whitening = math::whitening(projected);
    splat.colour = shade(cloud, i, camera.eye);
    splats.push_back(splat);
  }
  std::ranges::stable_sort(splats, {}, &ReferenceSplat::depth);
  return splats;
}

struct ReferencePixel {
  glm::dvec3 colour;
  double half_depth = std::numeric_limits<double>::infinity();
};

ReferencePixel render_pixel(std::span<const ReferenceSplat> splats, glm::ivec2 pixel_px,
                            const glm::vec3& background, std::uint64_t& pairs) {
  ReferencePixel out;
  auto pixel = math::empty_pixel<double>();
  const math::Vec2<double> p{pixel_px.x + 0.5, pixel_px.y + 0.5};
  for (const ReferenceSplat& splat : splats) {
    const double square =
        math::whitened_square(splat.whitening, {p.x - splat.centre_px.x, p.y - splat.centre_px.y});
    if (square > splat.reach) continue;
    const double before = pixel.transmittance;
    if (!math::blend(pixel, splat.log2_opacity - square, splat.colour)) break;
    if (before >= 0.5 && pixel.transmittance < 0.5) out.half_depth = splat.depth;
    ++pairs;
  }
  const auto colour = math::resolve(pixel, to_vec3(background));
  out.colour = {colour.x, colour.y, colour.z};
  return out;
}

void convert_to_i420(const std::vector<glm::dvec3>& rgb, const HostImage& image) {
  const glm::ivec2 size = image.size_px();
  const auto code = [](double v) { return static_cast<std::uint8_t>(std::lround(v)); };
  const auto at = [&](int x, int y) { return rgb[static_cast<std::size_t>(y) * size.x + x]; };
  for (int y = 0; y < size.y; ++y) {
    for (int x = 0; x < size.x; ++x) {
      const glm::dvec3 c = at(x, y);
      image.byte_row(0, y)[x] = code(math::luma_code(math::Vec3<double>{c.x, c.y, c.z}));
      if (x % 2 != 0 || y % 2 != 0) continue;
      const glm::dvec3 mean = 0.25 * (c + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1));
      const auto chroma = math::chroma_codes(math::Vec3<double>{mean.x, mean.y, mean.z});
      image.byte_row(1, y / 2)[x / 2] = code(chroma.x);
      image.byte_row(2, y / 2)[x / 2] = code(chroma.y);
    }
  }
}

struct Pixels {
  std::vector<glm::dvec3> colours;
  std::vector<double> half_depths;
  FrameStats stats;
};

Pixels render_eye(const GaussianCloud& cloud, const Camera& camera, const glm::vec3& background,
                  std::span<const glm::ivec2> pixels, ThreadPool& pool) {
  using Clock = std::chrono::steady_clock;
  const auto ms_since = [](Clock::time_point start) {
    return std::chrono::duration<float, std::milli>(Clock::now() - start).count();
  };
  Pixels out;
  const auto start = Clock::now();
  const std::vector<ReferenceSplat> splats = project_all(cloud, camera, pool);
  out.stats.visible = static_cast<std::uint32_t>(splats.size());
  out.stats.stage_ms[static_cast<std::size_t>(Stage::project)] = ms_since(start);

  const auto blend_start = Clock::now();
  constexpr std::size_t run = 64;  // pixels a task takes
  out.colours.resize(pixels.size());
  out.half_depths.resize(pixels.size());
  std::atomic<std::uint64_t> pairs{0};
  pool.parallel_for((pixels.size() + run - 1) / run, [&](std::size_t task) {
    std::uint64_t blended = 0;
    for (std::size_t i = task * run; i < std::min(pixels.size(), (task + 1) * run); ++i) {
      const ReferencePixel pixel = render_pixel(splats, pixels[i], background, blended);
      out.colours[i] = pixel.colour;
      out.half_depths[i] = pixel.half_depth;
    }
    pairs += blended;
  });
  out.stats.blended_pairs = pairs;
  out.stats.stage_ms[static_cast<std::size_t>(Stage::blend)] = ms_since(blend_start);
  return out;
}

void add(const FrameStats& stats, FrameStats& sum) {
  sum.visible += stats.visible;
  sum.blended_pairs += stats.blended_pairs;
  for (std::size_t i = 0; i < stage_count; ++i) sum.stage_ms[i] += stats.stage_ms[i];
}

/// Each eye is drawn by itself.
Pixels render_pixels(const GaussianCloud& cloud, const FrameRequest& request,
                     std::span<const glm::ivec2> pixels, ThreadPool& pool) {
  Pixels all{std::vector<glm::dvec3>(pixels.size()), std::vector<double>(pixels.size()), {}};
  int left = 0;
  for (const Camera& camera : cameras_of(request)) {
    std::vector<std::size_t> positions;  // of its pixels among all
    std::vector<glm::ivec2> own;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const glm::ivec2 pixel = pixels[i] - glm::ivec2(left, 0);
      if (pixel.x < 0 || pixel.x >= camera.size_px.x) continue;
      positions.push_back(i);
      own.push_back(pixel);
    }
    const Pixels part = render_eye(cloud, camera, request.background, own, pool);
    for (std::size_t i = 0; i < own.size(); ++i) {
      all.colours[positions[i]] = part.colours[i];
      all.half_depths[positions[i]] = part.half_depths[i];
    }
    add(part.stats, all.stats);
    left += camera.size_px.x;
  }
  return all;
}

/// The medians of a depth grid. A cell smaller than a pixel has the one around its middle.
std::vector<float> depth_cells(const std::vector<double>& half_depths, glm::ivec2 size_px,
                               glm::ivec2 cells) {
  std::vector<float> medians;
  for (int row = 0; row < cells.y; ++row) {
    for (int column = 0; column < cells.x; ++column) {
      const glm::ivec2 cell(column, row), middle = (2 * cell + 1) * size_px / (2 * cells);
      const glm::ivec2 begin = glm::min(cell * size_px / cells, middle);
      const glm::ivec2 end = glm::max((cell + 1) * size_px / cells, middle + 1);
      std::vector<float> values;
      for (int y = begin.y; y < end.y; ++y)
        for (int x = begin.x; x < end.x; ++x)
          values.push_back(
              static_cast<float>(1.0 / half_depths[static_cast<std::size_t>(y) * size_px.x + x]));
      const auto median = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
      std::ranges::nth_element(values, median);
      medians.push_back(*median);
    }
  }
  return medians;
}

class ReferenceView final : public View {
 public:
  ReferenceView(std::shared_ptr<const GaussianCloud> cloud, std::shared_ptr<ThreadPool> pool,
                const ViewSettings& settings)
      : cloud_(std::move(cloud)), pool_(std::move(pool)), settings_(settings) {}

  RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override {
    RenderStatus status = check_request(request, settings_.format);
    if (!status.ok()) return status;
    try {
      return render_checked(request, frame);
    } catch (const std::bad_alloc&) {
      return {RenderStatus::Code::out_of_memory, "reference: no memory for the frame"};
    }
  }

  std::size_t memory_bytes() const override { return image_.memory_bytes(); }

 private:
  RenderStatus render_checked(const FrameRequest& request, FrameView& frame) {
    const glm::ivec2 size = request.camera.size_px;
    std::vector<glm::ivec2> pixels;
    for (int y = 0; y < size.y; ++y)
      for (int x = 0; x < size.x; ++x) pixels.emplace_back(x, y);
    const Pixels image = render_pixels(*cloud_, request, pixels, *pool_);

    image_.resize(settings_.format, size);
    if (settings_.format == PixelFormat::i420) {
      convert_to_i420(image.colours, image_);
    } else {
      for (std::size_t i = 0; i < pixels.size(); ++i)
        for (int c = 0; c < 3; ++c)
          image_.rgb_row(pixels[i].y)[pixels[i].x * 3 + c] =
              static_cast<float>(image.colours[i][c]);
    }
    inverse_depths_ = depth_cells(image.half_depths, size, request.depth_cells);
    frame = {settings_.format, MemorySpace::host, size,
             image_.planes(),  image.stats,       {request.depth_cells, inverse_depths_}};
    return {};
  }

  std::shared_ptr<const GaussianCloud> cloud_;
  std::shared_ptr<ThreadPool> pool_;
  ViewSettings settings_;
  HostImage image_;
  std::vector<float> inverse_depths_;
};

class ReferenceRenderer final : public Renderer {
 public:
  ReferenceRenderer(std::shared_ptr<const GaussianCloud> cloud, std::shared_ptr<ThreadPool> pool)
      : cloud_(std::move(cloud)), pool_(std::move(pool)) {}

  std::string description() const override {
    return "reference, double precision, " + std::to_string(pool_->threads()) + " threads";
  }
  std::size_t scene_bytes() const override { return cloud_->bytes(); }
  std::unique_ptr<View> make_view(const ViewSettings& settings) override {
    if (keeps_colours(settings.pipeline)) {
      throw InputError("--pipeline", "", "the reference keeps nothing from frame to frame",
                       "use --pipeline exact");
    }
    return std::make_unique<ReferenceView>(cloud_, pool_, settings);
  }

 private:
  std::shared_ptr<const GaussianCloud> cloud_;
  std::shared_ptr<ThreadPool> pool_;
};

}  // namespace

std::vector<glm::dvec3> render_reference_pixels(const GaussianCloud& cloud,
                                                const FrameRequest& request,
                                                std::span<const glm::ivec2> pixels,
                                                ThreadPool& pool) {
  assert(check_request(request, PixelFormat::rgb_f32).ok());
  return render_pixels(cloud, request, pixels, pool).colours;
}

std::vector<glm::ivec2> random_pixels(glm::ivec2 size_px, std::size_t count, std::uint64_t seed) {
  assert(size_px.x > 0 && size_px.y > 0);
  // Selection sampling (Knuth, TAOCP 3.4.2, algorithm S).
  std::mt19937_64 random(seed);
  std::vector<glm::ivec2> pixels;
  std::size_t left = static_cast<std::size_t>(size_px.x) * static_cast<std::size_t>(size_px.y);
  std::size_t wanted = std::min(count, left);
  for (int y = 0; y < size_px.y; ++y) {
    for (int x = 0; x < size_px.x && wanted > 0; ++x, --left) {
      if (random() % left >= wanted) continue;
      pixels.emplace_back(x, y);
      --wanted;
    }
  }
  return pixels;
}

std::unique_ptr<Renderer> make_reference_renderer(std::shared_ptr<const GaussianCloud> cloud,
                                                  std::shared_ptr<ThreadPool> pool) {
  return std::make_unique<ReferenceRenderer>(std::move(cloud), std::move(pool));
}

}  // namespace catgs
