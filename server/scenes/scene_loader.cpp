#include "server/scenes/scene_loader.h"

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <utility>

#include "render_core/base/device_set.h"
#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/scene/tree/page_pools.h"

namespace catgs {
namespace {

/// Ends a load from within, for one that a visitor waits for.
struct GaveWay {};

}  // namespace

SceneLoader::SceneLoader(const ServerConfig& config, RendererOptions core, const SceneIds& ids,
                         SceneTrees& trees)
    : config_(config), core_(std::move(core)), ids_(ids), trees_(trees) {
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
  const auto load_as = [&](const SceneForm& form) {
    return load_scene(
        found.location, form, [&](const auto& name) { return ids_.id_of(spec, name); }, config_,
        core_, core_.pool->threads());
  };
  try {
    if (trees_.ready(found)) return load_as(*trees_.form_of(found));
  } catch (const UnusableTree& error) {
    trees_.discard(found, error.what());
  }
  try {
    if (!trees_.form_of(found)) trees_.build_now(found);
  } catch (const InputError& error) {
    trees_.give_up(found, error.what());
    throw;  // as a whole it does not fit
  }
  return load_as(trees_.form_of(found).value_or(SceneForm()));
}

LoadedScene SceneLoader::load(const FoundScene& found, const SceneForm& form,
                              bool gives_way) const {
  try {
    // Half of the processors stay free for the visitors' frames.
    const int threads = std::max(1, core_.pool->threads() / 2);
    return {load_scene(
        found.location, form, [&](const auto&) { return found.id; }, config_, core_, threads,
        [this, gives_way](double) {
          if (stopping_) throw std::runtime_error("the server stops");
          if (gives_way && give_way_) throw GaveWay();
        })};
  } catch (const GaveWay&) {
    return {.entry = nullptr, .gave_way = true};
  } catch (const UnusableTree& error) {
    return {nullptr, error.what(), true};
  } catch (const std::exception& error) {
    return {nullptr, error.what()};
  }
}

}  // namespace catgs
