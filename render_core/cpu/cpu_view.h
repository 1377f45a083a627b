#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/colour_cache.h"
#include "render_core/cpu/depth_sampler.h"
#include "render_core/cpu/kernels.h"
#include "render_core/cpu/occlusion.h"
#include "render_core/cpu/page_slots.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/cpu/tile_lists.h"
#include "render_core/frame/frame_driver.h"
#include "render_core/frame/paged_frame.h"
#include "render_core/frame/renderer.h"
#include "render_core/image/host_image.h"
#include "render_core/motion/frame_groups.h"

namespace catgs {

/// The data that all Views of a renderer share.
struct CpuScene {
  [[nodiscard]] const SceneStore& store() const { return pages ? pages->store() : *whole; }

  // One of the two: a scene that is in memory as a whole, or the pages of a tree.
  std::optional<SceneStore> whole;
  std::unique_ptr<PageSlots> pages;
  std::shared_ptr<ThreadPool> pool;
  SimdKernels kernels;
  std::unique_ptr<PagedTree> tree;  // of `pages`
};

/// Buffers of a frame, kept for the next one. In Pipeline::paper, those of a key frame are the
/// caches of its sub-frames: the visible Gaussians (the frustum cache) and the list of each tile
/// (the sort cache).
class CpuView final : public View {
 public:
  CpuView(std::shared_ptr<const CpuScene> scene, const ViewSettings& settings);

  RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override;
  std::vector<std::uint32_t> tile_loads() const override;
  std::size_t memory_bytes() const override;
  bool outdated() const override { return paged_ && paged_->outdated(); }

 private:
  /// One of the eyes that a frame is drawn for.
  struct EyeBuffers {
    Camera camera;
    ImagePlanes picture;  // in image_
    Occlusion occlusion;  // Pipeline::catgs
    DepthSampler depths;
    std::optional<ColourCache> colours{};
  };

  FrameView draw(const FrameRequest& request, const FramePlan& plan);
  void begin_eyes(const FrameRequest& request);
  void draw_boxes(FrameStats& stats);
  void draw_lists(const FrameRequest& request, const FramePlan& plan, FrameStats& stats);
  void draw_cached_lists(const Camera& camera, FrameStats& stats);
  void cull_clusters(const FramePlan& plan);
  void cut_tree(const FrameRequest& request, const FramePlan& plan);
  [[nodiscard]] bool is_hidden(const Cluster& bounds) const;
  template <class Done>
  void project(const FramePlan& plan, std::size_t shares, const Done& done);
  std::uint64_t blend(const FrameRequest& request);
  [[nodiscard]] DepthGrid finish_depths(glm::ivec2 cells);
  void summarise(FrameStats& stats) const;
  [[nodiscard]] std::size_t segments() const;
  [[nodiscard]] SplatTable table(const FramePlan& plan) const;
  [[nodiscard]] glm::ivec2 tiles_of_all() const;
  ClusterColours colours_of(std::size_t rank, EyeBuffers& eye) const;

  std::shared_ptr<const CpuScene> scene_;
  ViewSettings settings_;
  FrameDriver driver_;
  std::array<EyeBuffers, 2> both_eyes_;
  std::span<EyeBuffers> eyes_;  // those of the frame
  glm::ivec2 tiles_{0};         // of an eye's picture
  HostImage image_;
  std::vector<std::uint32_t> clusters_;    // [rank]: those that may be visible
  std::vector<float> shares_;              // [rank]: the part of the cluster that is drawn
  std::vector<NodeId> nodes_;              // [rank]: of a scene in pages
  std::vector<ClusterMembers> members_;    // [rank]: their visible Gaussians
  std::vector<ClusterSummary> summaries_;  // [rank]
  std::vector<std::uint32_t> counts_;      // [eye][rank]: visible Gaussians
  std::vector<Splat> splats_;              // [slot], see SplatTable
  std::vector<SplatPath> paths_;           // [slot]
  TileLists lists_;
  std::vector<float> inverse_depths_;  // of both eyes
  float mean_inverse_depth_ = 0.0f;    // of the last frame
  std::optional<PagedFrame> paged_;
};

}  // namespace catgs
