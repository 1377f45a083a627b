#include "server/scenes/scene_library.h"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include <boost/asio/post.hpp>
#include <fmt/format.h>

#include "render_core/base/device_set.h"
#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/frame/device_error.h"
#include "render_core/scene/tree/page_pools.h"
#include "server/base/log_event.h"
#include "server/base/scene_id.h"
#include "server/scenes/compute_walkable_area.h"
#include "server/scenes/scene_catalog.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto scan_interval = 30s;
constexpr auto seek_again_after = 5min;

std::set<std::string> keys_of(const std::vector<std::string>& scenes) {
  std::set<std::string> keys;
  for (const std::string& spec : scenes) keys.insert(scene_key(spec));
  return keys;
}

/// A quarter of the processors. Trees are built while visitors look.
int builder_threads(const RendererOptions& core) { return std::max(1, core.pool->threads() / 4); }

/// The renderer that was made first.
const std::string& renderer_text(const SceneIndex& index) {
  return index.records().at(index.preferred()).entry->renderer_text;
}

WalkableAreaSource source_of(const SceneRecord& record, const DerivedFiles* files) {
  WalkableAreaSource source = walkable_area_source(record.found.location, record.entry->facts);
  if (source.scene.format == nullptr) return source;  // procedural
  const std::string& tree = record.found.tree;
  if (files && files->contains(tree)) source.tree = files->path_of(tree);
  source.beside = record.entry->sidecar;
  if (!source.beside.empty()) source.beside.replace_extension(".walk");
  return source;
}

}  // namespace

SceneLibrary::SceneLibrary(const ServerConfig& config, RendererOptions core, Background& background,
                           boost::asio::io_context& io, Metrics& metrics,
                           std::function<TimePoint()> clock)
    : config_(config),
      io_(io),
      metrics_(metrics),
      clock_(std::move(clock)),
      files_(config.cache_dir.empty() ? nullptr : std::make_unique<DerivedFiles>(config.cache_dir)),
      trees_(config, files_.get(), builder_threads(core), background, io, metrics, clock_,
             [this](std::uint64_t bytes) { return memory_.could_fit(bytes); }),
      scan_options_{SceneIds(config.scenes, config.scene_folders), chosen_levels(config),
                    trees_.enabled()},
      folders_({config.scene_folders.begin(), config.scene_folders.end()}, scan_options_,
               keys_of(config.scenes)),
      loads_(config_, core, scan_options_.ids, trees_, files_.get(), background, io),
      memory_(config_, index_, trees_, loads_, metrics_, clock_),
      walkable_areas_(files_.get(), builder_threads(core), background, io) {
  pin_scenes();
  if (config_.scene_folders.empty())
    merge({});
  else
    open_folders();
  loads_.keep_core();
  memory_.publish();
  log_info({.event = "renderer"}, "renderer: {}", renderer_text(index_));
}

/// A bad scene is an operator's mistake that should stop the server.
void SceneLibrary::pin_scenes() {
  std::set<std::string> keys;
  for (const SceneLocation& scene : locate_scenes(config_)) {
    if (!keys.insert(scene_key(scene.given.string())).second) continue;  // given twice
    FoundScene found;
    found.location = scene;
    if (trees_.enabled() && scene.format != nullptr)
      found = read_scene_headers(scene, scan_options_);
    auto entry = loads_.load_now(found);
    const std::string id = entry->facts.scene_id;
    memory_.pin(id, *entry);
    SceneRecord& record = index_.record_of(id);
    record.found = std::move(found);
    record.found.name = entry->name;
    if (record.found.size.gaussians == 0) record.found.size.gaussians = entry->facts.gaussians;
    record.pinned = true;
    record.entry = std::move(entry);
    if (index_.preferred().empty()) index_.prefer(id);
    if (const std::string& text = record.entry->renderer_text; text != renderer_text(index_))
      log_info({.event = "renderer", .scene = id}, "scene {}: renderer {}", id, text);
  }
}

/// A running server can always show a scene: without others, the first one of the folders is loaded
/// that can be.
void SceneLibrary::open_folders() {
  std::vector<FoundScene> found = folders_.scan();
  log_info({.event = "scenes_found"}, "{} scenes in folders, loaded when somebody asks for them",
           found.size());
  merge(std::move(found));
  next_scan_ = clock_() + scan_interval;
  if (!index_.preferred().empty()) return;
  if (index_.records().empty())
    throw InputError("--scene-folder " + config_.scene_folders.front(), {}, "holds no scene",
                     "put one there, or give --scene");
  // Those that have to wait for their trees are the last choice.
  std::vector<std::string> ids;
  for (const auto& [id, record] : index_.records()) ids.push_back(id);
  std::ranges::stable_partition(ids, [this](const std::string& id) {
    return trees_.representation_of(index_.records().at(id).found).has_value();
  });
  std::optional<InputError> first_error;
  for (const std::string& id : ids) {
    try {
      memory_.load_now(id);
      return index_.prefer(id);
    } catch (const DevicesUnusable&) {
      throw;  // no other scene helps
    } catch (const InputError& error) {
      memory_.failed_now(id, error.what());
      if (!first_error) first_error = error;
    }
  }
  throw InputError(*first_error);
}

void SceneLibrary::on_tick(TimePoint now) {
  memory_.on_tick(now);
  metrics_.set_pages(index_.pages());
  if (!next_scan_ || now < *next_scan_) return;
  next_scan_.reset();
  loads_.scan(folders_, [this](std::optional<std::vector<FoundScene>> found) {
    next_scan_ = clock_() + scan_interval;
    if (found) merge(*std::move(found));
  });
}

void SceneLibrary::want_poster(const std::string& id) {
  boost::asio::post(io_, [this, id] { memory_.want_poster(id); });
}

void SceneLibrary::want_walkable_area(const std::string& id) {
  boost::asio::post(io_, [this, id] {
    SceneRecord* const record = index_.find(id);
    if (!record || !record->entry || record->walkable_area || record->outdated ||
        walkable_areas_.busy())
      return;
    if (record->walkable_area_retry_at && clock_() < *record->walkable_area_retry_at) return;
    const WalkableAreaSource source = source_of(*record, files_.get());
    walkable_areas_.find(
        id, source, [this, id, source, stamp = record->found.stamp](const auto& walkable_area) {
          SceneRecord* const found_for = index_.find(id);
          if (!found_for || !found_for->entry || found_for->walkable_area ||
              found_for->found.stamp != stamp ||
              !same_walkable_area(source, source_of(*found_for, files_.get())))
            return;
          found_for->walkable_area = walkable_area;
          if (!walkable_area) found_for->walkable_area_retry_at = clock_() + seek_again_after;
          memory_.publish();
        });
  });
}

void SceneLibrary::revise(const std::string& id, std::shared_ptr<const SceneEntry> entry) {
  SceneRecord* const record = index_.find(id);
  if (!record || !record->entry) return;
  if (record->former && record->former->renderer == entry->renderer)
    entry = redrawn(*entry, *record->entry);
  if (record->entry->renderer != entry->renderer) return;
  const WalkableAreaSource before = source_of(*record, files_.get());
  record->entry = unleased(std::move(entry), record->entry->renderer);
  if (!record->outdated && !same_walkable_area(before, source_of(*record, files_.get())))
    record->walkable_area.reset();
  memory_.publish();
}

void SceneLibrary::merge(std::vector<FoundScene> found) {
  index_.merge(std::move(found), [this](const std::string& id) { return memory_.awaited(id); });
  std::set<std::string> trees;
  for (const auto& [id, record] : index_.records())
    if (!record.found.tree.empty()) trees.insert(record.found.tree);
  trees_.keep(trees);
  memory_.publish();
}

}  // namespace catgs
