#include "server/scenes/scene_catalog.h"

#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/math/axis_name.h"
#include "render_core/scene/analysis/robust_bounds.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/scene.h"
#include "render_core/scene/tree/tree_file.h"
#include "render_core/synth/synth.h"
#include "server/base/log_event.h"
#include "server/net/http.h"
#include "server/scenes/poster.h"
#include "server/scenes/scene_facts.h"
#include "server/scenes/scene_ids.h"
#include "server/scenes/tours.h"

namespace catgs {
namespace {

constexpr float stray_share = 0.01f;  // of the Gaussians, beyond the content on each side

template <typename T>
T parse_number(const std::string& spec, std::string_view text) {
  T value{};
  const char* end = text.data() + text.size();
  if (text.empty() || std::from_chars(text.data(), end, value).ptr != end)
    throw InputError("--scene " + spec, {}, fmt::format("\"{}\" is not a number", text),
                     "give synth:city:300000 or synth:city:300000:SEED");
  return value;
}

/// synth:KIND:COUNT[:SEED]
struct SynthSpec {
  SynthKind kind;
  std::size_t count;
  std::uint64_t seed;
};

SynthSpec parse_synth(const std::string& spec) {
  std::vector<std::string_view> parts;
  for (std::string_view rest = spec; !rest.empty();) {
    const auto colon = std::min(rest.find(':'), rest.size());
    parts.push_back(rest.substr(0, colon));
    rest.remove_prefix(std::min(colon + 1, rest.size()));
  }
  if (parts.size() < 3 || parts.size() > 4)
    throw InputError("--scene " + spec, {}, "is incomplete", "give synth:city:300000");
  const auto count = parse_number<std::size_t>(spec, parts[2]);
  const std::uint64_t seed = parts.size() == 4 ? parse_number<std::uint64_t>(spec, parts[3]) : 1;
  return {parse_synth_kind(parts[1]), count, seed};
}

Scene synthesize(const std::string& spec) {
  const auto [kind, count, seed] = parse_synth(spec);
  return catgs::synthesize(kind, count, seed);
}

/// A tree of a cache can be built again, so it is used only if all of it is there.
SceneInPages open_cached(const std::filesystem::path& path, const SceneLocation& made_of,
                         const LoadOptions& options) {
  const auto refuse = [&](std::string_view why) { throw UnusableTree(path.string(), {}, why); };
  constexpr std::string_view damaged = "pages are missing or damaged";
  // A mistake in the sidecar is no fault of the tree: it throws InputError here.
  (void)model_in_sidecar(made_of.hints);
  try {
    TreeFile tree(std::make_unique<FileSource>(path));
    if (tree.pages_in_file() < tree.shape().pages() || !tree.page(0)) refuse(damaged);
    SceneInPages scene = open_in_pages(path, made_of, options);
    if (scene.tree->damage().pages > 0) refuse(damaged);
    return scene;
  } catch (const UnusableTree&) {
    throw;
  } catch (const InputError& error) {
    throw UnusableTree(path.string(), {}, error.what());
  }
}

/// A scene in memory; or, with a tree, its outline.
SceneInPages load(const SceneLocation& location, const SceneRepresentation& representation,
                  const ServerConfig& config, LoadOptions options) {
  if (location.format == nullptr) return {nullptr, synthesize(location.given.string())};
  if (!representation.tree.empty()) return open_cached(representation.tree, location, options);
  if (location.has_levels()) {
    const LoadOptions levels = chosen_levels(config);
    options.lod = levels.lod;
    options.gaussian_budget = levels.gaussian_budget;
    if (representation.most_gaussians > 0) {
      options.lod.reset();
      options.gaussian_budget = representation.most_gaussians;
    }
  }
  if (location.is_in_pages()) return open_in_pages(location, options);
  return {nullptr, load_scene(location, options)};
}

}  // namespace

void synthesize_parts(const std::string& spec, ThreadPool& pool,
                      const std::function<void(const GaussianCloud&)>& take) {
  const auto [kind, count, seed] = parse_synth(spec);
  catgs::synthesize_parts(kind, count, seed, pool, take);
}

std::uint64_t tree_memory(const ServerConfig& config) {
  constexpr std::uint64_t megabyte = 1'000'000;
  if (config.scene_memory_mb == 0) return RendererOptions{}.scene_memory;
  return static_cast<std::uint64_t>(config.scene_memory_mb) * megabyte / 2;
}

std::uint64_t most_bytes(const SceneSize& size, const ServerConfig& config) {
  return size.in_pages ? std::min(size.bytes(), tree_memory(config)) : size.bytes();
}

LoadOptions chosen_levels(const ServerConfig& config) {
  LoadOptions levels;
  if (config.lod >= 0) levels.lod = config.lod;
  if (config.gaussian_budget > 0)
    levels.gaussian_budget = static_cast<std::size_t>(config.gaussian_budget);
  return levels;
}

std::vector<SceneLocation> locate_scenes(const ServerConfig& config) {
  for (const std::string& spec : config.scenes)
    if (std::error_code error; !is_synthetic(spec) && !std::filesystem::exists(spec, error))
      throw InputError("--scene " + spec, {}, "there is no such file or folder",
                       "check the path, or try --scene synth:city:300000");
  std::vector<SceneLocation> scenes(config.scenes.size());
  std::ranges::transform(config.scenes, scenes.begin(), [](const std::string& spec) {
    return is_synthetic(spec) ? SceneLocation{.given = spec} : locate_scene(spec);
  });
  if ((config.lod >= 0 || config.gaussian_budget > 0) && config.scene_folders.empty() &&
      std::ranges::none_of(scenes, &SceneLocation::has_levels))
    throw InputError(config.lod >= 0 ? "--lod" : "--budget", {},
                     "no scene has levels of detail to choose from",
                     "levels and budgets are for streamed SOG, 3D Tiles and LCC2");
  return scenes;
}

std::shared_ptr<const SceneEntry> load_scene(
    const SceneLocation& location, const SceneRepresentation& representation,
    const std::function<std::string(const std::string& name)>& id_of, const ServerConfig& config,
    const RendererOptions& core, int threads, const std::function<void(double)>& progress,
    const KeepDerived& keep) {
  const std::string spec = location.given.string();
  if (representation.tree.empty())
    log_info({.event = "scene_loading"}, "loading {}", spec);
  else
    log_info({.event = "scene_loading"}, "loading {} from its tree {}", spec,
             representation.tree.string());
  const auto load_now = [&] {
    LoadOptions options;
    options.threads = threads;
    options.up = axis_named(config.up);
    options.progress = progress;
    options.keep_view = keep.view;
    return load(location, representation, config, std::move(options));
  };
  const std::filesystem::path& sidecar = location.hints.sidecar;
  std::optional<std::string> text = sidecar_text(sidecar);
  auto loaded = load_now();
  // Somebody may replace it during the load. Hints, tours and tag are those of one text.
  bool replaced = false;
  if (std::optional<std::string> now = sidecar_text(sidecar); now != text) {
    replaced = true;
    text = std::move(now);
    loaded = {};  // memory for one of them
    loaded = load_now();
  }
  auto& [tree, scene] = loaded;
  auto entry = std::make_shared<SceneEntry>();
  entry->name = scene.name;
  entry->facts.scene_id = id_of(scene.name);
  entry->facts.gaussians = tree ? tree->header().gaussians : scene.cloud.size();
  entry->facts.model = scene.cloud.model;
  entry->in_pages = tree != nullptr;
  entry->coarse = representation.most_gaussians > 0;
  entry->surface = std::make_shared<const SurfacePoints>(scene.cloud, *core.pool);
  if (const auto content = robust_bounds(scene.cloud, stray_share)) {
    entry->facts.content_min = content->min;
    entry->facts.content_max = content->max;
  }
  use_hints(scene.hints, scene.name, entry->surface.get(), entry->facts);
  for (const std::string& note : scene.notes)
    log_warning({.event = "scene_note", .scene = entry->facts.scene_id}, "{}: {}", spec, note);
  if (location.format != nullptr) {
    entry->sidecar = sidecar;
    if (text) entry->sidecar_tag = etag_of(*text);
    entry->tours = ToursAnswers(tours_of(entry->sidecar, text, config.media_origins));
  }
  auto made =
      tree ? make_renderer(tree, core)
           : make_renderer(std::make_shared<const GaussianCloud>(std::move(scene.cloud)), core);
  entry->renderer_text = fmt::format("{} ({})", made.renderer->description(), made.reason);
  entry->renderer = std::move(made.renderer);
  const auto draw = [&] { return make_poster(*entry->renderer, entry->facts); };
  entry->poster = keep.poster && !replaced ? keep.poster(draw) : draw();
  log_info({.event = "scene_loaded", .scene = entry->facts.scene_id},
           "scene {}: {} Gaussians, {}, {}{:.1f} MB per device, view from {}",
           entry->facts.scene_id, entry->facts.gaussians, scene.format,
           entry->in_pages ? "pages in a pool of " : "",
           static_cast<double>(entry->renderer->scene_bytes()) * 1e-6, scene.hints.source);
  return entry;
}

}  // namespace catgs
