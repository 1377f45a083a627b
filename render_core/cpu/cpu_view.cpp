#include "render_core/cpu/cpu_view.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <new>
#include <string>
#include <utility>

#include "render_core/math/constants.h"

namespace catgs {
namespace {

/// Adds the time from one call to the next to stages.
class StageClock {
 public:
  explicit StageClock(FrameStats& stats) : stats_(stats) {}
  void end(Stage stage) {
    const auto now = std::chrono::steady_clock::now();
    stats_.stage_ms[static_cast<std::size_t>(stage)] +=
        std::chrono::duration<float, std::milli>(now - last_).count();
    last_ = now;
  }

 private:
  FrameStats& stats_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Sub-frames of this core find their tiles where they are in the key frame.
SpeculationSettings on_fixed_grid(SpeculationSettings settings) {
  settings.grid = GridKind::fixed;
  return settings;
}

template <class T>
void grow(std::vector<T>& buffer, std::size_t size) {
  if (buffer.size() < size) buffer.resize(size);
}

}  // namespace

CpuView::CpuView(std::shared_ptr<const CpuScene> scene, const ViewSettings& settings)
    : scene_(std::move(scene)), settings_(settings), groups_(on_fixed_grid(settings.speculation)) {
  if (settings.pipeline == Pipeline::catgs && settings.colour_cache)
    colours_.emplace(scene_->store.clusters().size());
}

RenderStatus CpuView::render(const FrameRequest& request, FrameView& frame) noexcept {
  RenderStatus status = check_request(request, settings_.format);
  if (!status.ok()) return status;
  try {
    const FrameStats stats = draw(request);
    frame = {settings_.format, MemorySpace::host, request.camera.size_px, image_.planes(), stats};
  } catch (const std::bad_alloc&) {
    groups_.forget();
    return {RenderStatus::Code::out_of_memory,
            "CPU core: no memory for " + std::to_string(clusters_.size()) + " clusters in view"};
  }
  return {};
}

FrameStats CpuView::draw(const FrameRequest& request) {
  const Camera& camera = request.camera;
  grid_ = (camera.size_px + (tile_size_px - 1)) / tile_size_px;
  image_.resize(settings_.format, camera.size_px);
  blocks_.place(camera.size_px);
  FrameStats stats;
  if (settings_.pipeline == Pipeline::vanilla) {
    draw_boxes(camera, stats);
  } else if (settings_.pipeline == Pipeline::exact) {
    draw_key_lists(camera, nullptr, stats);
  } else {
    const FramePlan plan = groups_.plan(camera, request.forecast, {nearest_depth_, 0.0f});
    stats.kind = plan.kind;
    stats.window = plan.window;
    if (plan.kind == FrameKind::sub) {
      draw_sub_lists(camera, stats);
    } else {
      draw_key_lists(camera, plan.window > 0 ? &plan.window_end : nullptr, stats);
    }
  }
  StageClock clock(stats);
  stats.blended_pairs = blend(request);
  clock.end(Stage::blend);

  stats.nearest_depth = std::numeric_limits<float>::infinity();
  for (const ClusterSummary& summary : std::span(summaries_).first(clusters_.size())) {
    stats.visible += summary.visible;
    stats.nearest_depth = std::min(stats.nearest_depth, summary.nearest_depth);
    stats.displacement_px = std::max(stats.displacement_px, summary.longest_path_px);
  }
  nearest_depth_ = stats.nearest_depth;
  stats.tasks = lists_.tiles();  // each in one part
  stats.list_entries = lists_.entries();
  stats.list_max = lists_.longest();
  stats.overflowed_entries = lists_.overflowed_entries();
  return stats;
}

void CpuView::draw_boxes(const Camera& camera, FrameStats& stats) {
  StageClock clock(stats);
  cull_clusters(camera, nullptr);
  project(camera, nullptr, [](std::size_t, std::size_t) {});
  clock.end(Stage::project);
  lists_.build_by_keys(table(false), grid_, settings_.max_list_entries, *scene_->pool);
  clock.end(Stage::sort);
}

/// Lists for `camera`, and with `window_end` for all cameras on the way there.
void CpuView::draw_key_lists(const Camera& camera, const Camera* window_end, FrameStats& stats) {
  StageClock clock(stats);
  cull_clusters(camera, window_end);
  lists_.begin(grid_, segments(), settings_.max_list_entries);
  // Listed while they are in cache: reading them again would cost as much as the listing.
  project(camera, window_end, [&](std::size_t segment, std::size_t rank) {
    lists_.add(segment, table(window_end != nullptr).of_cluster(rank), scene_->kernels);
  });
  clock.end(Stage::project);
  lists_.finish(table(window_end != nullptr), scene_->kernels, *scene_->pool);
  clock.end(Stage::bin);
  lists_.sort(splats_, *scene_->pool);
  clock.end(Stage::sort);
}

void CpuView::draw_sub_lists(const Camera& camera, FrameStats& stats) {
  StageClock clock(stats);
  grow(depths_, splats_.size());
  const std::size_t ranks = clusters_.size(), shares = segments();
  const float min_depth = speculation_min_depth(settings_.speculation, camera.near_z);
  scene_->pool->parallel_for(shares, [&](std::size_t share) {
    for (std::size_t rank = ranks * share / shares; rank < ranks * (share + 1) / shares; ++rank) {
      const std::size_t first = rank * cluster_size;
      if (counts_[rank] == 0) continue;
      summaries_[rank] = scene_->kernels.refresh_cluster(
          {&scene_->store, &camera, clusters_[rank], &members_[rank], splats_.data() + first,
           depths_.data() + first, min_depth, colours_of(clusters_[rank], camera)});
    }
  });
  clock.end(Stage::project);
  if (settings_.order == BlendOrder::fresh) lists_.sort_again(splats_, depths_, *scene_->pool);
  clock.end(Stage::sort);
}

void CpuView::cull_clusters(const Camera& camera, const Camera* window_end) {
  const std::span<const Cluster> clusters = scene_->store.clusters();
  const ClusterCuller now(camera), end(window_end != nullptr ? *window_end : camera);
  const bool cull = settings_.pipeline != Pipeline::vanilla;
  clusters_.clear();
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    if (!cull || !outside_on_the_way(now, end, clusters[c]))
      clusters_.push_back(static_cast<std::uint32_t>(c));
  }
}

/// Shares of the visible clusters that threads take: more than threads, because some regions hold
/// far more that is visible than others, but each share costs a counter per tile.
std::size_t CpuView::segments() const {
  const auto threads = static_cast<std::size_t>(scene_->pool->threads());
  return std::min({threads * 8, std::max<std::size_t>(threads, 64), 1 + clusters_.size() / 8});
}

SplatTable CpuView::table(bool with_paths) const {
  return {splats_, with_paths ? paths_.data() : nullptr, counts_};
}

ClusterColours CpuView::colours_of(std::uint32_t cluster, const Camera& camera) {
  if (!colours_) return {nullptr, nullptr};
  return colours_->of_cluster(cluster, scene_->store.clusters()[cluster],
                              camera.world_from_camera.position);
}

/// Projects the visible clusters and calls done(share, rank) after each.
template <class Done>
void CpuView::project(const Camera& camera, const Camera* window_end, const Done& done) {
  const bool sweeps = window_end != nullptr;
  const std::size_t ranks = clusters_.size(), slots = ranks * cluster_size;
  grow(splats_, slots);
  if (sweeps) grow(paths_, slots);
  if (sweeps) grow(members_, ranks);
  summaries_.resize(ranks);
  counts_.resize(ranks);
  const Pipeline culling = sweeps                                    ? Pipeline::catgs
                           : settings_.pipeline == Pipeline::vanilla ? Pipeline::vanilla
                                                                     : Pipeline::exact;
  const float min_depth = speculation_min_depth(settings_.speculation, camera.near_z);
  const std::size_t shares = segments();
  scene_->pool->parallel_for(shares, [&](std::size_t share) {
    for (std::size_t rank = ranks * share / shares; rank < ranks * (share + 1) / shares; ++rank) {
      const std::size_t first = rank * cluster_size;
      summaries_[rank] = scene_->kernels.project_cluster(
          {&scene_->store, &camera, culling, clusters_[rank], splats_.data() + first, min_depth,
           colours_of(clusters_[rank], camera), window_end,
           sweeps ? paths_.data() + first : nullptr, sweeps ? &members_[rank] : nullptr});
      counts_[rank] = summaries_[rank].visible;
      done(share, rank);
    }
  });
}

std::uint64_t CpuView::blend(const FrameRequest& request) {
  std::atomic<std::uint64_t> pairs{0};
  const std::span<const std::uint32_t> tiles = lists_.tiles_by_length();
  scene_->pool->parallel_for(tiles.size(), [&](std::size_t i) {
    const std::uint32_t tile = tiles[i];
    const std::uint64_t blended = scene_->kernels.blend_blocks(
        {splats_.data(), lists_.list(tile), blocks_.of_tile(tile), request.background,
         settings_.pipeline != Pipeline::vanilla, settings_.count_pairs, &image_});
    if (settings_.count_pairs) pairs += blended;
  });
  return pairs;
}

std::vector<std::uint32_t> CpuView::tile_loads() const {
  std::vector<std::uint32_t> loads(lists_.tiles());
  for (std::size_t tile = 0; tile < loads.size(); ++tile) {
    loads[tile] = static_cast<std::uint32_t>(lists_.list(tile).size());
  }
  return loads;
}

std::size_t CpuView::memory_bytes() const {
  const auto bytes = [](const auto& buffer) { return buffer.capacity() * sizeof(buffer[0]); };
  return image_.memory_bytes() + (colours_ ? colours_->memory_bytes() : 0) + lists_.memory_bytes() +
         blocks_.memory_bytes() + bytes(clusters_) + bytes(members_) + bytes(summaries_) +
         bytes(counts_) + bytes(splats_) + bytes(paths_) + bytes(depths_);
}

}  // namespace catgs
