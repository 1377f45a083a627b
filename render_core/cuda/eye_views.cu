#include <algorithm>
#include <cstring>
#include <exception>
#include <utility>

#include <cuda_runtime_api.h>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/eye_views.cuh"
#include "render_core/frame/device_error.h"

namespace catgs::cuda {
namespace {

FrameStats sum_of(const FrameStats& a, const FrameStats& b) {
  FrameStats sum = a;
  sum.visible += b.visible;
  sum.list_entries += b.list_entries;
  sum.list_max = std::max(a.list_max, b.list_max);
  sum.overflowed_entries += b.overflowed_entries;
  sum.blended_pairs += b.blended_pairs;
  sum.tasks += b.tasks;
  sum.nodes = std::max(a.nodes, b.nodes);
  sum.finest_level = std::min(a.finest_level, b.finest_level);
  sum.coarsest_level = std::max(a.coarsest_level, b.coarsest_level);
  sum.missing_pages = std::max(a.missing_pages, b.missing_pages);
  sum.coarsest_px = std::max(a.coarsest_px, b.coarsest_px);
  sum.settled = a.settled && b.settled;
  sum.nearest_depth = std::min(a.nearest_depth, b.nearest_depth);
  sum.mean_inverse_depth = 0.5f * (a.mean_inverse_depth + b.mean_inverse_depth);
  for (std::size_t i = 0; i < stage_count; ++i) sum.stage_ms[i] += b.stage_ms[i];
  return sum;
}

/// Depth grids of eyes side by side.
std::vector<float> side_by_side(const DepthGrid& left, const DepthGrid& right) {
  std::vector<float> both;
  const auto columns = static_cast<std::size_t>(left.cells.x);
  for (std::size_t row = 0; row < static_cast<std::size_t>(left.cells.y); ++row) {
    for (const DepthGrid* grid : {&left, &right}) {
      const auto cells = grid->inverse_depths.subspan(row * columns, columns);
      both.insert(both.end(), cells.begin(), cells.end());
    }
  }
  return both;
}

}  // namespace

EyeViews::EyeViews(std::shared_ptr<const DeviceScene> scene, int device,
                   const ViewSettings& settings)
    : scene_(scene),
      device_(device),
      settings_(settings),
      left_(std::move(scene), device, settings) {}

RenderStatus EyeViews::render(const FrameRequest& request, FrameView& frame) noexcept {
  try {
    if (request.stereo) return render_both(request, frame);
    if (right_) {
      check(cudaSetDevice(device_), "device");
      right_.reset();
      rgb_.release();
    }
  } catch (const std::exception& error) {
    return status_of(error);
  }
  return left_.render(request, frame);
}

RenderStatus EyeViews::render_both(const FrameRequest& request, FrameView& frame) {
  if (RenderStatus bad = check_request(request, settings_.format); !bad.ok()) return bad;
  check(cudaSetDevice(device_), "device");
  if (!right_) right_.emplace(scene_, device_, settings_);
  const std::vector<Camera> cameras = cameras_of(request);
  FrameRequest of_eye = request;
  of_eye.stereo.reset();
  of_eye.forecast.reset();  // no sub-frame follows
  of_eye.depth_cells.x /= 2;
  FrameView left, right;
  of_eye.camera = cameras.front();
  if (RenderStatus failed = left_.render(of_eye, left); !failed.ok()) return failed;
  of_eye.camera = cameras.back();
  if (RenderStatus failed = right_->render(of_eye, right); !failed.ok()) return failed;
  frame = side_by_side(left, right);
  return {};
}

FrameView EyeViews::side_by_side(const FrameView& left, const FrameView& right) {
  const glm::ivec2 size_px = left.size_px * glm::ivec2(2, 1);
  FrameView both = left;
  both.size_px = size_px;
  both.stats = sum_of(left.stats, right.stats);
  if (left.space == MemorySpace::device) {
    const auto width = static_cast<std::size_t>(size_px.x);
    rgb_.reserve(3 * width * static_cast<std::size_t>(size_px.y));
    both.planes[0] = {reinterpret_cast<std::byte*>(rgb_.get()), 3 * sizeof(float) * width};
  } else {
    image_.resize(left.format, size_px);
    both.planes = image_.planes();
  }
  copy_to_half(left, 0);
  copy_to_half(right, left.size_px.x);
  if (left.depths.cells != glm::ivec2(0)) {
    inverse_depths_ = cuda::side_by_side(left.depths, right.depths);
    both.depths = {left.depths.cells * glm::ivec2(2, 1), inverse_depths_};
  }
  return both;
}

/// Copies an eye's picture to where it lies in that of both, from column `left_px` on.
void EyeViews::copy_to_half(const FrameView& of_eye, int left_px) {
  const auto width = static_cast<std::size_t>(of_eye.size_px.x);
  const auto height = static_cast<std::size_t>(of_eye.size_px.y);
  constexpr std::size_t pixel = 3 * sizeof(float);
  if (of_eye.space == MemorySpace::device) {
    check(cudaMemcpy2D(rgb_.get() + 3 * static_cast<std::size_t>(left_px), 2 * pixel * width,
                       of_eye.planes[0].data, of_eye.planes[0].stride_bytes, pixel * width, height,
                       cudaMemcpyDeviceToDevice),
          "halves");
    check(cudaStreamSynchronize(nullptr), "halves");  // the next frame may overwrite what is read
    return;
  }
  const ImagePlanes half = image_.part(left_px, of_eye.size_px);
  const bool rgb = of_eye.format == PixelFormat::rgb_f32;
  for (std::size_t plane = 0; plane < (rgb ? 1u : 3u); ++plane) {
    const std::size_t shrink = plane == 0 ? 1 : 2, row_bytes = rgb ? pixel * width : width / shrink;
    const Plane &from = of_eye.planes[plane], &to = half.planes()[plane];
    for (std::size_t y = 0; y < height / shrink; ++y)
      std::memcpy(to.data + y * to.stride_bytes, from.data + y * from.stride_bytes, row_bytes);
  }
}

std::vector<std::uint32_t> EyeViews::tile_loads() const {
  std::vector<std::uint32_t> loads = left_.tile_loads();
  if (right_) {
    const std::vector<std::uint32_t> right = right_->tile_loads();
    loads.insert(loads.end(), right.begin(), right.end());
  }
  return loads;
}

std::size_t EyeViews::memory_bytes() const {
  return left_.memory_bytes() + (right_ ? right_->memory_bytes() : 0) + rgb_.bytes() +
         image_.memory_bytes() + inverse_depths_.capacity() * sizeof(float);
}

bool EyeViews::outdated() const { return left_.outdated() || (right_ && right_->outdated()); }

}  // namespace catgs::cuda
