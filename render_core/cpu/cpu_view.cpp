#include "render_core/cpu/cpu_view.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <utility>

#include "render_core/math/constants.h"
#include "render_core/motion/list_culler.h"

namespace catgs {
namespace {

/// Measures stages: each call adds the time since the call before.
class StageClock {
 public:
  explicit StageClock(FrameStats& stats) : stats_(stats) {}
  void end(Stage stage) {
    const auto now = std::chrono::steady_clock::now();
    stats_.stage_ms[static_cast<std::size_t>(stage)] +=
        std::chrono::duration<float, std::milli>(now - last_).count();
    last_ = now;
  }
  void restart() { last_ = std::chrono::steady_clock::now(); }

 private:
  FrameStats& stats_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

template <class T>
void grow(std::vector<T>& buffer, std::size_t size) {
  if (buffer.size() < size) buffer.resize(size);
}

}  // namespace

CpuView::CpuView(std::shared_ptr<const CpuScene> scene, const ViewSettings& settings)
    : scene_(std::move(scene)), settings_(settings), driver_(settings) {
  settings_.colour_cache = settings.colour_cache && keeps_colours(settings.pipeline);
  if (settings_.colour_cache) both_eyes_.front().colours.emplace(scene_->store().clusters().size());
  if (scene_->tree) paged_.emplace(*scene_->tree, settings);
}

RenderStatus CpuView::render(const FrameRequest& request, FrameView& frame) noexcept {
  return driver_.render(
      request, frame, [&](const FramePlan& plan) { return draw(request, plan); },
      [&] {
        for (EyeBuffers& eye : both_eyes_) eye.occlusion.forget();
      });
}

/// Sets what the eyes of a frame see, and where in the image they see it.
void CpuView::begin_eyes(const FrameRequest& request) {
  const std::vector<Camera> cameras = cameras_of(request);
  const glm::ivec2 size_px = cameras.front().size_px;
  const glm::ivec2 cells = request.depth_cells / glm::ivec2(static_cast<int>(cameras.size()), 1);
  image_.resize(settings_.format, request.camera.size_px);
  tiles_ = (size_px + (tile_size_px - 1)) / tile_size_px;
  eyes_ = std::span(both_eyes_).first(cameras.size());
  for (std::size_t i = 0; i < eyes_.size(); ++i) {
    EyeBuffers& eye = eyes_[i];
    eye.camera = cameras[i];
    eye.picture = image_.part(static_cast<int>(i) * size_px.x, size_px);
    eye.depths.begin(size_px, cells);
    if (settings_.colour_cache && !eye.colours)
      eye.colours.emplace(scene_->store().clusters().size());
    if (settings_.pipeline == Pipeline::catgs)
      eye.occlusion.begin(eye.camera, mean_inverse_depth_, scene_->kernels, *scene_->pool);
  }
  for (EyeBuffers& unused : std::span(both_eyes_).subspan(eyes_.size())) {
    unused.occlusion.forget();
    unused.colours.reset();
  }
}

FrameView CpuView::draw(const FrameRequest& request, const FramePlan& plan) {
  FrameStats stats;
  StageClock clock(stats);
  begin_eyes(request);
  clock.end(Stage::project);
  if (settings_.pipeline == Pipeline::vanilla) {
    draw_boxes(stats);
  } else if (plan.kind == FrameKind::key) {
    draw_lists(request, plan, stats);
  } else {
    draw_cached_lists(request.camera, stats);
  }
  clock.restart();
  stats.blended_pairs = blend(request);
  const DepthGrid depths = finish_depths(request.depth_cells);
  clock.end(Stage::blend);
  if (settings_.pipeline == Pipeline::catgs)
    for (EyeBuffers& eye : eyes_) eye.occlusion.finish();
  summarise(stats);
  if (paged_) paged_->end(stats);
  mean_inverse_depth_ = stats.mean_inverse_depth;
  return {settings_.format, MemorySpace::host, image_.size_px(), image_.planes(), stats, depths};
}

void CpuView::summarise(FrameStats& stats) const {
  stats.nearest_depth = std::numeric_limits<float>::infinity();
  double inverse_depths = 0.0;
  std::uint64_t counted = 0;
  for (const ClusterSummary& summary : std::span(summaries_).first(clusters_.size())) {
    stats.visible += summary.visible + summary.visible_to_second;
    stats.nearest_depth = std::min(stats.nearest_depth, summary.nearest_depth);
    stats.displacement_px = std::max(stats.displacement_px, summary.longest_path_px);
    inverse_depths += static_cast<double>(summary.inverse_depth_sum);
    counted += summary.counted;
  }
  if (counted > 0)
    stats.mean_inverse_depth = static_cast<float>(inverse_depths / static_cast<double>(counted));
  stats.nodes = static_cast<std::uint32_t>(clusters_.size());
  if (!nodes_.empty()) {
    const auto [finest, coarsest] = std::ranges::minmax(nodes_, {}, &NodeId::level);
    stats.finest_level = finest.level;
    stats.coarsest_level = coarsest.level;
  }
  stats.tasks = lists_.tiles();  // each tile is one part
  stats.list_entries = lists_.entries();
  stats.list_max = lists_.longest();
  stats.overflowed_entries = lists_.overflowed_entries();
}

void CpuView::draw_boxes(FrameStats& stats) {
  StageClock clock(stats);
  const FramePlan plan{.window_end = eyes_.front().camera};
  cull_clusters(plan);
  project(plan, segments(), [](std::size_t, std::size_t) {});
  clock.end(Stage::project);
  lists_.build_by_keys(table(plan), tiles_of_all(), settings_.max_list_entries, *scene_->pool);
  clock.end(Stage::sort);
}

/// Makes the lists of a frame, and with a window for all cameras on the way to its end.
void CpuView::draw_lists(const FrameRequest& request, const FramePlan& plan, FrameStats& stats) {
  StageClock clock(stats);
  if (paged_) {
    cut_tree(request, plan);
  } else {
    cull_clusters(plan);
  }
  const std::size_t shares = segments(), ranks = clusters_.size();
  lists_.begin(tiles_of_all(), shares, settings_.max_list_entries);
  // Listed while the splats are in cache. Reading them again would cost as much as the listing.
  project(plan, shares, [&](std::size_t segment, std::size_t rank) {
    for (std::size_t e = 0; e < eyes_.size(); ++e)
      lists_.add(segment, table(plan).of_cluster(e * ranks + rank), scene_->kernels);
  });
  clock.end(Stage::project);
  lists_.finish(table(plan), scene_->kernels, *scene_->pool);
  clock.end(Stage::bin);
  lists_.sort(splats_, *scene_->pool);
  clock.end(Stage::sort);
}

/// Refreshes the splats of the key frame's lists, which keep their order.
void CpuView::draw_cached_lists(const Camera& camera, FrameStats& stats) {
  StageClock clock(stats);
  const std::size_t ranks = clusters_.size(), shares = segments();
  const float min_depth = speculation_min_depth(settings_.speculation, camera.near_z);
  scene_->pool->parallel_for(shares, [&](std::size_t share) {
    for (std::size_t rank = ranks * share / shares; rank < ranks * (share + 1) / shares; ++rank) {
      if (counts_[rank] == 0) continue;
      summaries_[rank] = scene_->kernels.refresh_cluster(
          {&scene_->store(), &camera, clusters_[rank], &members_[rank],
           splats_.data() + rank * cluster_size, min_depth, shares_[rank],
           colours_of(rank, eyes_.front())});
    }
  });
  clock.end(Stage::project);
}

/// Finds the clusters that an eye may see.
void CpuView::cull_clusters(const FramePlan& plan) {
  const std::span<const Cluster> clusters = scene_->store().clusters();
  std::vector<ListCuller> cullers;
  for (const EyeBuffers& eye : eyes_)
    cullers.emplace_back(eye.camera, plan.window > 0 ? plan : FramePlan{.window_end = eye.camera});
  const auto is_seen = [&](const Cluster& cluster) {
    for (std::size_t i = 0; i < eyes_.size(); ++i)
      if (!cullers[i].outside(cluster) && !eyes_[i].occlusion.hides(cluster)) return true;
    return false;
  };
  const bool cull = settings_.pipeline != Pipeline::vanilla;
  clusters_.clear();
  for (std::size_t c = 0; c < clusters.size(); ++c)
    if (!cull || is_seen(clusters[c])) clusters_.push_back(static_cast<std::uint32_t>(c));
  shares_.assign(clusters_.size(), 1.0f);
}

/// Whether the last frame shows that a cluster is hidden from all eyes.
bool CpuView::is_hidden(const Cluster& bounds) const {
  return std::ranges::all_of(eyes_,
                             [&](const EyeBuffers& eye) { return eye.occlusion.hides(bounds); });
}

/// Finds the clusters of a scene in pages, and how much of each is drawn.
void CpuView::cut_tree(const FrameRequest& request, const FramePlan& plan) {
  paged_->begin(request, plan);
  const PageTable& table = paged_->table();
  clusters_.clear();
  shares_.clear();
  nodes_.clear();
  CutParts parts{.part = CutParts::Part::drawn};
  if (std::ranges::all_of(eyes_,
                          [](const EyeBuffers& eye) { return bool(eye.occlusion.limits()); }))
    parts.hides = [this](const Cluster& bounds) { return is_hidden(bounds); };
  const Cut cut = table.cut(paged_->cameras(), request.detail_px, paged_->now_s(), parts);
  const TreeShape& shape = table.shape();
  const std::span<const Cluster> clusters = scene_->store().clusters();
  const std::size_t drawn = cut.drawn.size();
  const auto cluster_at = [&](std::size_t i) {
    return static_cast<std::uint32_t>(cut.slots[i] * shape.slots() +
                                      shape.slot_of(cut.drawn[i].node));
  };
  constexpr std::size_t ahead = 8;  // bounds are far apart in memory
  for (std::size_t i = 0; i < drawn; ++i) {
    if (i + ahead < drawn) __builtin_prefetch(&clusters[cluster_at(i + ahead)]);
    const std::uint32_t c = cluster_at(i);
    if (is_hidden(clusters[c])) continue;
    clusters_.push_back(c);
    shares_.push_back(cut.drawn[i].share);
    nodes_.push_back(cut.drawn[i].node);
  }
}

/// Number of shares that the visible clusters are cut into for the threads. More than threads,
/// because some regions hold far more that is visible than others; but each share costs a counter
/// per tile.
std::size_t CpuView::segments() const {
  const auto threads = static_cast<std::size_t>(scene_->pool->threads());
  return std::min({threads * 8, std::max<std::size_t>(threads, 64), 1 + clusters_.size() / 8});
}

SplatTable CpuView::table(const FramePlan& plan) const {
  SplatTable table{splats_, plan.window > 0 ? paths_.data() : nullptr, counts_,
                   eyes_.front().occlusion.limits()};
  if (eyes_.size() > 1)
    table.second = {clusters_.size(), tiles_.y, eyes_.back().occlusion.limits()};
  return table;
}

/// Those of the second eye are below those of the first.
glm::ivec2 CpuView::tiles_of_all() const {
  return tiles_ * glm::ivec2(1, static_cast<int>(eyes_.size()));
}

/// The colours of a cluster that an eye has seen.
ClusterColours CpuView::colours_of(std::size_t rank, EyeBuffers& eye) const {
  if (!eye.colours) return {nullptr, nullptr};
  const std::uint32_t cluster = clusters_[rank];
  const std::uint64_t page = paged_ ? paged_->table().shape().page_of(nodes_[rank]) : 0;
  return eye.colours->of_cluster(cluster, page, scene_->store().clusters()[cluster],
                                 colour_eye(eye.camera));
}

/// Projects the visible clusters in `shares` and calls done(share, rank) after each.
template <class Done>
void CpuView::project(const FramePlan& plan, std::size_t shares, const Done& done) {
  const bool sweeps = plan.window > 0;
  const std::size_t ranks = clusters_.size(), slots = ranks * cluster_size;
  grow(splats_, slots * eyes_.size());
  if (sweeps) grow(paths_, slots);
  if (sweeps) grow(members_, ranks);
  summaries_.resize(ranks);
  counts_.resize(ranks * eyes_.size());
  // A key frame of the paper without a window is an exact frame.
  const bool is_exact = settings_.pipeline == Pipeline::paper && !sweeps;
  EyeBuffers &left = eyes_.front(), &right = eyes_.back();
  const float min_depth = speculation_min_depth(settings_.speculation, left.camera.near_z);
  scene_->pool->parallel_for(shares, [&](std::size_t share) {
    for (std::size_t rank = ranks * share / shares; rank < ranks * (share + 1) / shares; ++rank) {
      const std::size_t first = rank * cluster_size;
      ProjectTask task{.scene = &scene_->store(),
                       .camera = &left.camera,
                       .pipeline = is_exact ? Pipeline::exact : settings_.pipeline,
                       .cluster = clusters_[rank],
                       .splats = splats_.data() + first,
                       .min_depth = min_depth,
                       .share = shares_[rank],
                       .limits = left.occlusion.limits(),
                       .colours = colours_of(rank, left),
                       .window_end = &plan.window_end,
                       .paths = sweeps ? paths_.data() + first : nullptr,
                       .members = sweeps ? &members_[rank] : nullptr};
      if (eyes_.size() > 1)
        task.second = {&right.camera, splats_.data() + slots + first, right.occlusion.limits(),
                       colours_of(rank, right)};
      summaries_[rank] = scene_->kernels.project_cluster(task);
      counts_[rank] = summaries_[rank].visible;
      if (eyes_.size() > 1) counts_[ranks + rank] = summaries_[rank].visible_to_second;
      done(share, rank);
    }
  });
}

std::uint64_t CpuView::blend(const FrameRequest& request) {
  const bool fills = settings_.pipeline == Pipeline::catgs;
  std::atomic<std::uint64_t> pairs{0};
  const std::span<const std::uint32_t> tiles = lists_.tiles_by_length();
  scene_->pool->parallel_for(tiles.size(), [&](std::size_t i) {
    const auto index = static_cast<int>(tiles[i]);
    const int row = index / tiles_.x;
    const glm::ivec2 tile(index % tiles_.x, row % tiles_.y);
    EyeBuffers& eye = eyes_[static_cast<std::size_t>(row / tiles_.y)];
    const std::uint64_t blended =
        scene_->kernels.blend_tile({.splats = splats_.data(),
                                    .list = lists_.list(tiles[i]),
                                    .first_px = tile * tile_size_px,
                                    .background = request.background,
                                    .cull_blocks = settings_.pipeline != Pipeline::vanilla,
                                    .fills = fills,
                                    .count_pairs = settings_.count_pairs,
                                    .image = &eye.picture,
                                    .ends = fills ? eye.occlusion.ends_of_tile(tile) : PartEnds{},
                                    .depths = eye.depths.of_tile(tile)});
    if (settings_.count_pairs) pairs += blended;
  });
  return pairs;
}

/// The grids of the eyes side by side.
DepthGrid CpuView::finish_depths(glm::ivec2 cells) {
  if (eyes_.size() == 1) return eyes_.front().depths.finish(*scene_->pool);
  inverse_depths_.resize(static_cast<std::size_t>(cells.x) * static_cast<std::size_t>(cells.y));
  auto to = inverse_depths_.begin();
  for (EyeBuffers& eye : eyes_) {
    const DepthGrid grid = eye.depths.finish(*scene_->pool);
    const auto columns = static_cast<std::size_t>(grid.cells.x);
    for (std::size_t row = 0; row < static_cast<std::size_t>(grid.cells.y); ++row)
      std::ranges::copy(grid.inverse_depths.subspan(row * columns, columns),
                        to + static_cast<std::ptrdiff_t>(row * static_cast<std::size_t>(cells.x)));
    to += grid.cells.x;
  }
  return {cells, inverse_depths_};
}

std::vector<std::uint32_t> CpuView::tile_loads() const {
  std::vector<std::uint32_t> loads;
  for (std::size_t tile = 0; tile < lists_.tiles(); ++tile)
    loads.push_back(static_cast<std::uint32_t>(lists_.list(tile).size()));
  return loads;
}

std::size_t CpuView::memory_bytes() const {
  const auto bytes = [](const auto& buffer) { return buffer.capacity() * sizeof(buffer[0]); };
  std::size_t of_eyes = 0;
  for (const EyeBuffers& eye : both_eyes_)
    of_eyes += eye.occlusion.memory_bytes() + eye.depths.memory_bytes() +
               (eye.colours ? eye.colours->memory_bytes() : 0);
  return image_.memory_bytes() + lists_.memory_bytes() + of_eyes + bytes(inverse_depths_) +
         bytes(clusters_) + bytes(shares_) + bytes(nodes_) + bytes(members_) + bytes(summaries_) +
         bytes(counts_) + bytes(splats_) + bytes(paths_);
}

}  // namespace catgs
