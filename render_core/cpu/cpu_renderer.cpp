#include "render_core/cpu/cpu_renderer.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <chrono>
#include <new>
#include <numeric>
#include <string>
#include <utility>

#include "render_core/cpu/kernels.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/cpu/tile_lists.h"
#include "render_core/error.h"
#include "render_core/host_image.h"
#include "render_core/math/constants.h"

namespace catgs {
namespace {

/// Adds the time from one call to the next to stages.
class StageClock {
 public:
  void end(Stage stage, FrameStats& stats) {
    const auto now = std::chrono::steady_clock::now();
    stats.stage_ms[static_cast<std::size_t>(stage)] +=
        std::chrono::duration<float, std::milli>(now - last_).count();
    last_ = now;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// What all Views of a renderer share; constant after construction.
struct SharedScene {
  SceneStore store;
  std::shared_ptr<ThreadPool> pool;
  SimdKernels kernels;
};

class CpuView final : public View {
 public:
  CpuView(std::shared_ptr<const SharedScene> shared, const ViewSettings& settings)
      : shared_(std::move(shared)), settings_(settings) {}

  RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override {
    RenderStatus status = check_request(request, settings_.format);
    if (!status.ok()) return status;
    try {
      frame = render_checked(request);
    } catch (const std::bad_alloc&) {
      return {RenderStatus::Code::out_of_memory, "CPU core: no memory for " +
                                                     std::to_string(visible_clusters_.size()) +
                                                     " clusters in view"};
    }
    return {};
  }

  std::size_t memory_bytes() const override {
    return image_.memory_bytes() + lists_.memory_bytes() + splats_.capacity() * sizeof(Splat) +
           (visible_clusters_.capacity() + visible_counts_.capacity()) * sizeof(std::uint32_t);
  }

 private:
  FrameView render_checked(const FrameRequest& request);
  void cull_clusters(const Camera& camera);
  [[nodiscard]] std::size_t segments() const;
  template <class Done>
  void project(const Camera& camera, const Done& done);
  std::uint64_t blend(const FrameRequest& request, glm::ivec2 grid);

  std::shared_ptr<const SharedScene> shared_;
  ViewSettings settings_;
  HostImage image_;
  // Buffers of a frame, kept for the next one. Slot = rank of a visible cluster x cluster_size +
  // position among its visible Gaussians.
  std::vector<std::uint32_t> visible_clusters_;
  std::vector<std::uint32_t> visible_counts_;  // per visible cluster
  std::vector<Splat> splats_;                  // [slot]
  TileLists lists_;
};

FrameView CpuView::render_checked(const FrameRequest& request) {
  ThreadPool& pool = *shared_->pool;
  const Camera& camera = request.camera;
  const glm::ivec2 grid = (camera.size_px + (tile_size_px - 1)) / tile_size_px;
  image_.resize(settings_.format, camera.size_px);
  FrameStats stats;
  StageClock clock;

  cull_clusters(camera);
  if (settings_.pipeline == Pipeline::vanilla) {
    project(camera, [](std::size_t, std::size_t) {});
    clock.end(Stage::project, stats);
    lists_.build_by_keys(splats_, visible_counts_, grid, settings_.max_list_entries, pool);
    clock.end(Stage::sort, stats);
  } else {
    lists_.begin(grid, segments(), settings_.max_list_entries);
    // Listed while they are in cache: reading them again would cost as much as the listing.
    project(camera, [&](std::size_t segment, std::size_t rank) {
      const std::size_t first = rank * cluster_size;
      lists_.add(segment, std::span(splats_).subspan(first, visible_counts_[rank]),
                 static_cast<std::uint32_t>(first), shared_->kernels);
    });
    clock.end(Stage::project, stats);
    lists_.finish(splats_, visible_counts_, shared_->kernels, pool);
    clock.end(Stage::bin, stats);
    lists_.sort(splats_, pool);
    clock.end(Stage::sort, stats);
  }

  stats.blended_pairs = blend(request, grid);
  clock.end(Stage::blend, stats);

  stats.visible = std::accumulate(visible_counts_.begin(), visible_counts_.end(), 0u);
  stats.list_entries = lists_.entries();
  stats.list_max = lists_.longest();
  stats.overflowed_entries = lists_.overflowed_entries();
  return {settings_.format, MemorySpace::host, camera.size_px, image_.planes(), stats};
}

void CpuView::cull_clusters(const Camera& camera) {
  const std::span<const Cluster> clusters = shared_->store.clusters();
  const ClusterCuller culler(camera);
  const bool cull = settings_.pipeline != Pipeline::vanilla;
  visible_clusters_.clear();
  for (std::size_t c = 0; c < clusters.size(); ++c)
    if (!cull || !culler.outside(clusters[c]))
      visible_clusters_.push_back(static_cast<std::uint32_t>(c));
}

/// Shares of the visible clusters that threads take: more than threads, because some regions hold
/// far more that is visible than others, but each share costs a counter per tile.
std::size_t CpuView::segments() const {
  const auto threads = static_cast<std::size_t>(shared_->pool->threads());
  return std::min(
      {threads * 8, std::max<std::size_t>(threads, 64), 1 + visible_clusters_.size() / 8});
}

/// Projects the visible clusters and calls done(segment, rank) after each.
template <class Done>
void CpuView::project(const Camera& camera, const Done& done) {
  const std::size_t ranks = visible_clusters_.size();
  if (splats_.size() < ranks * cluster_size) splats_.resize(ranks * cluster_size);
  visible_counts_.resize(ranks);
  const std::size_t shares = segments();
  shared_->pool->parallel_for(shares, [&](std::size_t share) {
    for (std::size_t rank = ranks * share / shares; rank < ranks * (share + 1) / shares; ++rank) {
      visible_counts_[rank] = shared_->kernels.project_cluster(
          {&shared_->store, &camera, settings_.pipeline, visible_clusters_[rank],
           splats_.data() + rank * cluster_size});
      done(share, rank);
    }
  });
}

std::uint64_t CpuView::blend(const FrameRequest& request, glm::ivec2 grid) {
  std::atomic<std::uint64_t> pairs{0};
  const std::span<const std::uint32_t> tiles = lists_.tiles_by_length();
  shared_->pool->parallel_for(tiles.size(), [&](std::size_t i) {
    const std::uint32_t tile = tiles[i];
    const auto index = static_cast<int>(tile);
    const std::uint64_t blended =
        shared_->kernels.blend_tile({splats_.data(),
                                     lists_.list(tile),
                                     {index % grid.x, index / grid.x},
                                     request.background,
                                     settings_.pipeline != Pipeline::vanilla,
                                     settings_.count_pairs,
                                     &image_});
    if (settings_.count_pairs) pairs += blended;
  });
  return pairs;
}

class CpuRenderer final : public Renderer {
 public:
  explicit CpuRenderer(std::shared_ptr<const SharedScene> shared) : shared_(std::move(shared)) {}

  std::string description() const override {
    const int threads = shared_->pool->threads();
    return "CPU, " + std::string(shared_->kernels.name) + ", " + std::to_string(threads) +
           (threads == 1 ? " thread" : " threads");
  }
  std::size_t scene_bytes() const override { return shared_->store.bytes(); }
  std::unique_ptr<View> make_view(const ViewSettings& settings) override {
    if (settings.pipeline == Pipeline::catgs) {
      throw InputError("--pipeline catgs", "", "the CPU core has no sub-frames yet",
                       "use --pipeline exact");
    }
    return std::make_unique<CpuView>(shared_, settings);
  }

 private:
  std::shared_ptr<const SharedScene> shared_;
};

const SimdKernels& choose_kernels(std::string_view simd) {
  const std::span<const SimdKernels> all = simd_kernels();
  const auto same = [](std::string_view a, std::string_view b) {
    return std::ranges::equal(
        a, b, {}, [](unsigned char c) { return std::tolower(c); },
        [](unsigned char c) { return std::tolower(c); });
  };
  if (same(simd, "auto")) return all.front();
  std::string names;
  for (const SimdKernels& kernels : all) {
    if (same(simd, kernels.name)) return kernels;
    names.append(", ").append(kernels.name);
  }
  throw InputError("--simd", "", "this machine has no \"" + std::string(simd) + "\"",
                   "use auto" + names);
}

}  // namespace

std::vector<std::string_view> simd_targets() {
  std::vector<std::string_view> names;
  for (const SimdKernels& kernels : simd_kernels()) names.push_back(kernels.name);
  return names;
}

std::unique_ptr<Renderer> make_cpu_renderer(const GaussianCloud& cloud,
                                            std::shared_ptr<ThreadPool> pool,
                                            std::string_view simd) {
  const SimdKernels& kernels = choose_kernels(simd);
  auto shared = std::make_shared<const SharedScene>(
      SharedScene{SceneStore(cloud, *pool), std::move(pool), kernels});
  return std::make_unique<CpuRenderer>(std::move(shared));
}

}  // namespace catgs
