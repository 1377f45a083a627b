#include "server/scenes/scene_loader.h"

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <utility>

#include "render_core/base/device_set.h"
#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/scene/tree/page_pools.h"
#include "server/base/log_event.h"
#include "server/scenes/kept_posters.h"
#include "server/scenes/kept_views.h"

namespace catgs {

SceneLoader::SceneLoader(const ServerConfig& config, RendererOptions core, const SceneIds& ids,
                         SceneTrees& trees, const DerivedFiles* files, Background& background,
                         boost::asio::io_context& io)
    : config_(config),
      core_(std::move(core)),
      ids_(ids),
      trees_(trees),
      files_(files),
      jobs_(background, io) {
  core_.pages = std::make_shared<PagePools>(tree_memory(config));
}

/// With GPUs, the processors are reserved for encoding, so a later scene that no GPU can load is
/// refused. Without, pools and budgets count no GPU.
void SceneLoader::keep_core() {
  const bool on_gpus = core_.devices && !core_.devices->views().empty();
  if (core_.kind == RendererKind::automatic)
    core_.kind = on_gpus ? RendererKind::cuda : RendererKind::cpu;
}

std::shared_ptr<const SceneEntry> SceneLoader::load_now(const FoundScene& found) {
  const std::string spec = found.location.given.string();
  const auto load_as = [&](const SceneRepresentation& representation) {
    return load_scene(
        found.location, representation, [&](const auto& name) { return ids_.id_of(spec, name); },
        config_, core_, core_.pool->threads(), {}, keep(found, representation));
  };
  try {
    if (trees_.ready(found)) return load_as(*trees_.representation_of(found));
  } catch (const UnusableTree& error) {
    trees_.discard(found, error.what());
  }
  try {
    if (!trees_.representation_of(found)) trees_.build_now(found);
  } catch (const InputError& error) {
    trees_.give_up(found, error.what());
    throw;  // as a whole it does not fit
  }
  return load_as(trees_.representation_of(found).value_or(SceneRepresentation()));
}

Background::JobId SceneLoader::load_beside(Present present, const FoundScene& found,
                                           const SceneRepresentation& representation, For whom,
                                           std::function<void(LoadedScene)> then) {
  return jobs_.start_then(
      lanes.scenes, whom == For::visitors ? Priority::high : Priority::normal,
      [this, found, representation, present = std::move(present)](const auto& stop) {
        LoadedScene loaded = load_on(found, representation, stop);
        if (loaded.entry && present.renderer)
          loaded.compared = compared(*loaded.entry, present, stop);
        return loaded;
      },
      [then = std::move(then)](Finished<LoadedScene> loaded) {
        const bool gave_way = loaded.error.empty();
        then(loaded.result
                 ? *std::move(loaded.result)
                 : LoadedScene{.entry = nullptr, .error = loaded.error, .gave_way = gave_way});
      });
}

LoadedScene SceneLoader::load_on(const FoundScene& found, const SceneRepresentation& representation,
                                 const std::stop_token& stop) const {
  try {
    // Half of the processors stay free for the visitors' frames.
    const int threads = std::max(1, core_.pool->threads() / 2);
    return {load_scene(
        found.location, representation, [&](const auto&) { return found.id; }, config_, core_,
        threads, [&](double) { throw_if_stopped(stop); }, keep(found, representation))};
  } catch (const UnusableTree& error) {
    return {nullptr, error.what(), true};
  } catch (const std::exception& error) {
    return {nullptr, error.what()};
  }
}

TreeComparison SceneLoader::compared(const SceneEntry& entry, const Present& present,
                                     const std::stop_token& stop) const {
  Renderer &tree = entry.in_pages ? *entry.renderer : *present.renderer,
           &other = entry.in_pages ? *present.renderer : *entry.renderer;
  const bool whole = entry.in_pages ? present.whole : !entry.coarse;
  return compare_tree(tree, other, whole, entry.facts, static_cast<float>(config_.detail_px),
                      [&] { throw_if_stopped(stop); });
}

void SceneLoader::read_poster(const FoundScene& found, const SceneRepresentation& representation,
                              std::function<void(const Poster&)> then) {
  if (!files_) return then(nullptr);
  jobs_.start_then(
      lanes.scenes, Priority::normal,
      [this, found, representation](const auto&) {
        return kept_poster(files_, found, representation, config_);
      },
      [then = std::move(then)](const Finished<Poster>& kept) {
        then(kept.result.value_or(nullptr));
      });
}

KeepDerived SceneLoader::keep(const FoundScene& found,
                              const SceneRepresentation& representation) const {
  return {keep_view(files_, found.location, config_),
          keep_poster(files_, found, representation, config_)};
}

void SceneLoader::free_later(std::shared_ptr<const SceneEntry> entry) {
  jobs_.start(lanes.scenes, Priority::high, [entry = std::move(entry)](const auto&) {});
}

void SceneLoader::scan(SceneFolders& folders,
                       std::function<void(std::optional<std::vector<FoundScene>>)> then) {
  jobs_.start_then(
      lanes.scenes, Priority::normal, [&folders](const auto&) { return folders.scan(); },
      [then = std::move(then)](Finished<std::vector<FoundScene>> found) {
        if (!found.result)  // a missing mount: its scenes stay offered
          log_warning({.event = "scene_folder_unreadable"}, "{}", found.error);
        then(std::move(found.result));
      });
}

}  // namespace catgs
