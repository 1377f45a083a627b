#include "server/scenes/scene_loader.h"

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/device_set.h"
#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/scene/tree/page_pools.h"
#include "server/base/log_event.h"
#include "server/scenes/kept_views.h"
#include "server/scenes/tours.h"

namespace catgs {
namespace {

constexpr std::size_t most_poster_bytes = 1 << 20;  // in --cache-dir

/// By all that a poster shows: the scene's files and levels, and what decides where visits begin.
/// Throws InputError.
std::string poster_name(const FoundScene& found, const SceneRepresentation& representation,
                        const ServerConfig& config) {
  constexpr int version = 2;  // of how posters are drawn
  const SceneLocation& scene = found.location;
  const std::string facts = fmt::format(
      "{}\n{} {} {}\n{}", found.tree.empty() ? tree_name(scene, chosen_levels(config)) : found.tree,
      version, config.up, representation.most_gaussians,
      sidecar_text(scene.hints.sidecar).value_or(""));
  return derived_name(scene, facts + camera_facts(scene.hints), ".jpg");
}

void check_jpeg(const ByteSource& file) {
  const std::vector<std::byte> bytes = file.read_all(most_poster_bytes);
  const std::size_t size = bytes.size();
  constexpr std::byte marker{0xff}, start{0xd8}, end{0xd9};
  if (size < 4 || bytes[0] != marker || bytes[1] != start || bytes[size - 2] != marker ||
      bytes[size - 1] != end)
    throw InputError(file.name(), {}, "is no whole JPEG file");
}

}  // namespace

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
        config_, core_, core_.pool->threads(), {}, keep_view(files_, found.location, config_));
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

void SceneLoader::load(const FoundScene& found, const SceneRepresentation& representation, For whom,
                       std::function<void(LoadedScene)> then) {
  const bool waits = whom == For::visitors;
  const auto id = jobs_.start_then(
      lanes.scenes, waits ? Priority::high : Priority::normal,
      [this, found, representation](const auto& stop) {
        return load_on(found, representation, stop);
      },
      [then = std::move(then)](Finished<LoadedScene> loaded) {
        then(loaded.result ? *std::move(loaded.result)
                           : LoadedScene{.entry = nullptr, .gave_way = true});
      });
  if (!waits) gives_way_ = id;
}

LoadedScene SceneLoader::load_on(const FoundScene& found, const SceneRepresentation& representation,
                                 const std::stop_token& stop) const {
  try {
    // Half of the processors stay free for the visitors' frames.
    const int threads = std::max(1, core_.pool->threads() / 2);
    return {load_scene(
        found.location, representation, [&](const auto&) { return found.id; }, config_, core_,
        threads, [&](double) { throw_if_stopped(stop); },
        keep_view(files_, found.location, config_))};
  } catch (const UnusableTree& error) {
    return {nullptr, error.what(), true};
  } catch (const std::exception& error) {
    return {nullptr, error.what()};
  }
}

void SceneLoader::load_poster(const FoundScene& found, const SceneRepresentation& representation,
                              std::function<void(std::optional<Poster>)> then) {
  gives_way_ = jobs_.start_then(
      lanes.scenes, Priority::normal,
      [this, found, representation](const auto& stop) {
        return poster_of(found, representation, stop);
      },
      [then = std::move(then)](Finished<Poster> made) {
        then(made.error.empty() ? std::move(made.result) : Poster());
      });
}

/// The scene goes here, in the background: that may wait for the device.
SceneLoader::Poster SceneLoader::poster_of(const FoundScene& found,
                                           const SceneRepresentation& representation,
                                           const std::stop_token& stop) const {
  const std::string name = files_ ? poster_name(found, representation, config_) : "";
  if (auto kept = files_ ? files_->read(name, most_poster_bytes, check_jpeg) : std::nullopt)
    return std::make_shared<const std::string>(*std::move(kept));
  const LoadedScene loaded = load_on(found, representation, stop);
  const Poster poster = loaded.entry ? loaded.entry->poster : nullptr;
  if (files_ && poster) files_->write(name, *poster, DerivedFiles::most_posters);
  return poster;
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
