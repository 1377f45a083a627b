#pragma once

// What the tests of single stages of the CUDA core share. Each runs one stage on the device,
// compares what it wrote with its twin on the CPU, by a bound of its own, and prints the
// difference.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/kernels.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/cuda/cuda_renderer.h"
#include "render_core/cuda/device_pages.cuh"
#include "render_core/cuda/list_builder.cuh"
#include "render_core/cuda/stream.h"
#include "render_core/cuda/view_memory.cuh"
#include "tests/support/camera_moves.h"
#include "tests/support/test_scenes.h"

namespace catgs::cuda::stages {

/// Skips its tests where no device is, with the core's own reason.
class StageTest : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string obstacle = cuda_obstacle(); !obstacle.empty()) GTEST_SKIP() << obstacle;
  }
};

/// The largest of some differences. Prints it and checks the bound at its end.
class Difference {
 public:
  Difference(std::string what, double bound) : what_(std::move(what)), bound_(bound) {}
  ~Difference() {
    std::cout << "[  stage   ] " << what_ << ": " << worst_ << " of " << bound_ << " allowed, "
              << count_ << " compared\n";
    EXPECT_LE(worst_, bound_) << what_;
    EXPECT_GT(count_, 0u) << what_;
  }
  Difference(const Difference&) = delete;
  Difference& operator=(const Difference&) = delete;

  void add(double difference) {
    ++count_;
    worst_ = std::isnan(difference) ? std::numeric_limits<double>::infinity()
                                    : std::max(worst_, std::abs(difference));
  }

 private:
  std::string what_;
  double bound_, worst_ = 0.0;
  std::size_t count_ = 0;
};

/// Counts what differs. Prints the share and checks the bound at its end.
class Mismatches {
 public:
  Mismatches(std::string what, double most_share) : what_(std::move(what)), most_(most_share) {}
  ~Mismatches() {
    std::cout << "[  stage   ] " << what_ << ": " << differ_ << " of " << count_ << " differ, "
              << 100.0 * most_ << " % allowed\n";
    EXPECT_LE(static_cast<double>(differ_), most_ * static_cast<double>(count_)) << what_;
    EXPECT_GT(count_, 0u) << what_;
  }
  Mismatches(const Mismatches&) = delete;
  Mismatches& operator=(const Mismatches&) = delete;

  void add(bool differs) {
    ++count_;
    differ_ += differs ? 1 : 0;
  }

 private:
  std::string what_;
  double most_;
  std::size_t differ_ = 0, count_ = 0;
};

template <class T>
DeviceBuffer<T> upload(const std::vector<T>& values) {
  DeviceBuffer<T> buffer;
  buffer.reserve(std::max<std::size_t>(values.size(), 1));
  check(cudaMemcpy(buffer.get(), values.data(), values.size() * sizeof(T), cudaMemcpyHostToDevice),
        "test upload");
  return buffer;
}

/// Waits for all streams.
template <class T>
std::vector<T> fetch(const T* data, std::size_t count) {
  check(cudaDeviceSynchronize(), "stage");
  std::vector<T> values(count);
  check(cudaMemcpy(values.data(), data, count * sizeof(T), cudaMemcpyDeviceToHost), "test fetch");
  return values;
}

inline int processors() {
  int count = 0;
  check(cudaDeviceGetAttribute(&count, cudaDevAttrMultiProcessorCount, 0), "device");
  return count;
}

/// The picture and its tiles, without room for anything else.
inline FrameShape picture_shape(glm::ivec2 size_px) {
  FrameShape shape;
  shape.width_px = size_px.x;
  shape.height_px = size_px.y;
  shape.grid_width_px = size_px.x;
  shape.grid_height_px = size_px.y;
  shape.tiles_x = (size_px.x + tile_side_px - 1) / tile_side_px;
  shape.tiles_y = (size_px.y + tile_side_px - 1) / tile_side_px;
  return shape;
}

/// A scene as both cores hold it.
struct StagedScene {
  explicit StagedScene(const GaussianCloud& of)
      : cloud(of),
        order(morton_order(cloud.mean, pool)),
        device({cloud, order, pool}),
        store(cloud, pool) {}

  ThreadPool pool{2};
  const GaussianCloud& cloud;
  std::vector<std::uint32_t> order;  // index in the cloud of each Gaussian on the device
  DeviceScene device;
  SceneStore store;
};

/// A Gaussian as the CPU core projects it.
struct CpuSplat {
  catgs::Splat splat;
  std::optional<catgs::SplatPath> path;
};

/// The stages that make lists, on both cores, for a camera and a plan.
class StagedLists {
 public:
  StagedLists(const StagedScene& scene, const Camera& camera, const FramePlan& plan,
              const ViewSettings& settings)
      : scene_(scene),
        camera_(camera),
        plan_(plan),
        builder_(memory_, processors()),
        request_(camera, plan, settings.speculation),
        shape_(picture_shape(camera.size_px)) {
    request_.scene = scene.device.arrays();
    shape_.visible_bound = std::max(scene.device.arrays().count, 1u);
    shape_.list_bound = 64 * shape_.visible_bound + 4096;
    (void)memory_.reserve({.shape = shape_,
                           .scene = scene.device.arrays(),
                           .in_pages = false,
                           .settings = settings,
                           .windows = true});
  }

  [[nodiscard]] const FrameShape& shape() const { return shape_; }
  [[nodiscard]] const ListRequest& request() const { return request_; }
  [[nodiscard]] const ViewMemory& memory() const { return memory_; }
  [[nodiscard]] FrameCounts counts() const { return fetch(memory_.counts.get(), 1)[0]; }

  /// From now on, splats are hidden as `occlusion` says.
  void hide(const Occlusion& occlusion) { request_.occlusion = occlusion; }
  void cull() { builder_.cull(request_, shape_, stream_.get()); }
  void project() { builder_.project(request_, shape_, stream_.get()); }
  void sort_by_depth() { builder_.sort_by_depth(shape_, stream_.get()); }
  void emit() { builder_.emit(request_, shape_, stream_.get()); }

  /// What the CPU core has in view, by index in the cloud; nothing for the others.
  [[nodiscard]] std::vector<std::optional<CpuSplat>> on_cpu() const {
    std::vector<std::optional<CpuSplat>> found(scene_.cloud.size());
    const bool sweeps = plan_.window > 0;
    std::vector<catgs::Splat> splats(cluster_size);
    std::vector<catgs::SplatPath> paths(cluster_size);
    ClusterMembers members{};
    for (std::size_t c = 0; c < scene_.store.clusters().size(); ++c) {
      const ClusterSummary summary = simd_kernels().front().project_cluster(
          {.scene = &scene_.store,
           .camera = &camera_,
           .pipeline = sweeps ? Pipeline::paper : Pipeline::exact,
           .cluster = c,
           .splats = splats.data(),
           .min_depth = request_.min_depth,
           .window_end = &plan_.window_end,
           .paths = sweeps ? paths.data() : nullptr,
           .members = sweeps ? &members : nullptr});
      for (std::uint32_t i = 0; i < summary.visible; ++i)
        found[scene_.order[splats[i].scene_order]] = {
            splats[i], sweeps ? std::optional(paths[i]) : std::nullopt};
    }
    return found;
  }

 private:
  const StagedScene& scene_;
  Camera camera_;
  FramePlan plan_;
  Stream stream_;
  ViewMemory memory_;
  ListBuilder builder_;
  ListRequest request_;
  FrameShape shape_;
};

/// A key frame without a window, or with one.
enum class Listed { now, window };

/// Thousands of Gaussians around the camera's target, and lists for a walk towards it.
struct StagedCase {
  explicit StagedCase(Listed listed, std::size_t gaussians = 20'000,
                      glm::ivec2 size_px = {320, 200}) {
    cloud = catgs::test::random_cloud(gaussians, 3, 7);
    camera = make_camera(catgs::test::look_at({1, 0, 1}, {-0.5f, 0.5f, 6}), size_px,
                         static_cast<float>(size_px.x));
    settings = catgs::test::patient_settings();
    if (listed == Listed::now) settings.pipeline = Pipeline::exact;
    FrameGroups groups(settings.speculation);
    const Pose end = catgs::test::moved(camera.world_from_camera, catgs::test::moves().back());
    plan = groups.plan(
        camera,
        listed == Listed::now ? std::nullopt : std::optional(Forecast{end, catgs::test::window}),
        0.0f);
    EXPECT_EQ(plan.window > 0, listed == Listed::window);
  }

  GaussianCloud cloud;
  Camera camera;
  ViewSettings settings;
  FramePlan plan;
};

class ListStage : public StageTest, public testing::WithParamInterface<Listed> {};

inline std::string name_of(const testing::TestParamInfo<Listed>& info) {
  return info.param == Listed::now ? "now" : "window";
}

}  // namespace catgs::cuda::stages
