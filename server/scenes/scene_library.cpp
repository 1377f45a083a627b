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
#include "server/scenes/ground_of_scene.h"
#include "server/scenes/scene_catalog.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto scan_interval = 30s;
constexpr auto retry_after_failure = 30s;
constexpr auto seek_ground_again_after = 5min;
constexpr std::size_t most_prepared = 2;

std::vector<std::filesystem::path> paths(const std::vector<std::string>& names) {
  return {names.begin(), names.end()};
}

ResidencyLimits residency_limits(const ServerConfig& config) {
  constexpr std::uint64_t megabyte = 1'000'000;
  return {static_cast<std::uint64_t>(config.scene_memory_mb) * megabyte, tree_memory(config),
          std::chrono::seconds(config.scene_residency_s)};
}

std::set<std::string> keys_of(const std::vector<std::string>& scenes) {
  std::set<std::string> keys;
  for (const std::string& spec : scenes) keys.insert(scene_key(spec));
  return keys;
}

std::string megabytes(std::uint64_t bytes) {
  return fmt::format("{:.1f} MB", 1e-6 * static_cast<double>(bytes));
}

/// A quarter of the processors. Trees are built while visitors look.
int builder_threads(const RendererOptions& core) { return std::max(1, core.pool->threads() / 4); }

ErrorMessage refusal(SceneResidency::Wish wish, const std::string& id, std::uint64_t bytes) {
  if (wish == SceneResidency::Wish::too_large)
    return {ErrorCode::unknown_scene,
            fmt::format("the scene \"{}\" takes {}, more than this server has for scenes",
                        name_in(id), megabytes(bytes)),
            false};
  if (wish == SceneResidency::Wish::no_room)
    return {
        ErrorCode::server_full,
        fmt::format("there is no memory for \"{}\" while others look at other scenes: try again "
                    "in a minute",
                    name_in(id)),
        false};
  return {ErrorCode::server_full, "other scenes are being loaded: try again in a minute", false};
}

/// The pages of trees that are in memory.
std::vector<ScenePages> pages_of(const SceneShelf& shelf) {
  std::vector<ScenePages> all;
  for (const auto& [id, book] : shelf.books())
    if (book.entry)
      for (const PageFigures& figures : book.entry->renderer->pages()) all.push_back({id, figures});
  return all;
}

GroundSource ground_source_of(const SceneBook& book, const SceneTrees& trees,
                              const ServerConfig& config) {
  GroundSource source = ground_source(book.found.location, book.entry->facts);
  if (source.scene.format == nullptr) return source;  // procedural
  if (trees.ready(book.found)) source.tree = trees.form_of(book.found)->tree;
  source.levels = chosen_levels(config);
  source.beside = book.entry->sidecar;
  if (!source.beside.empty()) source.beside.replace_extension(".walk");
  return source;
}

}  // namespace

SceneLibrary::SceneLibrary(const ServerConfig& config, RendererOptions core,
                           boost::asio::io_context& io, Metrics& metrics,
                           std::function<TimePoint()> clock)
    : config_(config),
      core_(std::move(core)),
      io_(io),
      metrics_(metrics),
      clock_(std::move(clock)),
      trees_(config, builder_threads(core_), io, metrics, clock_,
             [this](std::uint64_t bytes) { return residency_.could_fit(bytes); }),
      look_{SceneIds(config.scenes, config.scene_folders), chosen_levels(config), trees_.enabled()},
      folders_(paths(config.scene_folders), look_, keys_of(config.scenes)),
      residency_(residency_limits(config)),
      in_use_([this](const std::string& id) {
        const SceneBook* const book = shelf_.find(id);
        return book && book->in_use();
      }),
      redrawing_(shelf_, trees_, residency_, io, loader_,
                 [this](const auto& found, const auto& form) { return load(found, form); }),
      grounds_(config.cache_dir, builder_threads(core_), io) {
  core_.pages = std::make_shared<PagePools>(tree_memory(config));
  pin_scenes();
  if (config_.scene_folders.empty())
    merge({});
  else
    open_folders();
  // The first scenes decide whether the server uses GPUs. With GPUs, the processors are reserved
  // for encoding, so a later scene that no GPU can load is refused. Without, pools and budgets
  // count no GPU.
  const bool on_gpus = core_.devices && !core_.devices->views().empty();
  if (core_.kind == RendererKind::automatic)
    core_.kind = on_gpus ? RendererKind::cuda : RendererKind::cpu;
  publish();
}

/// A bad scene is an operator's mistake that should stop the server.
void SceneLibrary::pin_scenes() {
  std::set<std::string> keys;
  for (const SceneLocation& scene : locate_scenes(config_)) {
    if (!keys.insert(scene_key(scene.given.string())).second) continue;  // given twice
    FoundScene found;
    found.location = scene;
    if (trees_.enabled() && scene.format != nullptr) found = look_at_scene(scene, look_);
    auto entry = load_now(found);
    const std::string id = entry->facts.scene_id;
    residency_.pin(id, need_of(*entry));
    SceneBook& book = shelf_.book_of(id);
    book.found = std::move(found);
    book.found.name = entry->name;
    if (book.found.size.gaussians == 0) book.found.size.gaussians = entry->facts.gaussians;
    book.pinned = true;
    book.entry = std::move(entry);
    if (shelf_.preferred().empty()) shelf_.prefer(id);
    // The banner shows the first scene's renderer.
    if (const std::string& text = book.entry->renderer_text; text != renderer_text())
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
  if (!shelf_.preferred().empty()) return;
  if (shelf_.books().empty())
    throw InputError("--scene-folder " + config_.scene_folders.front(), {}, "holds no scene",
                     "put one there, or give --scene");
  // Those that have to wait for their trees are the last choice.
  std::vector<std::string> ids;
  for (const auto& [id, book] : shelf_.books()) ids.push_back(id);
  std::ranges::stable_partition(ids, [this](const std::string& id) {
    return trees_.form_of(shelf_.books().at(id).found).has_value();
  });
  std::optional<InputError> first_error;
  for (const std::string& id : ids) {
    try {
      return begin_with(id);
    } catch (const DevicesUnusable&) {
      throw;  // no other scene helps
    } catch (const InputError& error) {
      on_loaded(id, {nullptr, error.what()}, clock_(), clock_());
      if (!first_error) first_error = error;
    }
  }
  throw InputError(*first_error);
}

void SceneLibrary::begin_with(const std::string& id) {
  const FoundScene& found = shelf_.books().at(id).found;
  const TimePoint now = clock_();
  const auto wish = residency_.want(id, trees_.need_of(found), now, in_use_);
  if (wish != SceneResidency::Wish::awaited)
    throw InputError("--scene-memory", {}, refusal(wish, id, trees_.bytes_of(found)).message);
  residency_.next(now, in_use_);
  auto entry = load_now(found);
  shelf_.prefer(id);
  on_loaded(id, {std::move(entry)}, now, clock_());
}

SceneLibrary::~SceneLibrary() {
  stopping_ = true;
  loader_.join();
}

std::shared_ptr<const SceneEntry> SceneLibrary::load_now(const FoundScene& found) {
  const std::string spec = found.location.given.string();
  const auto load_as = [&](const SceneForm& form) {
    return load_scene(
        found.location, form, [&](const auto& name) { return look_.ids.id_of(spec, name); },
        config_, core_, core_.pool->threads());
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

SceneAnswer SceneLibrary::want(const std::string& id, TimePoint now) {
  std::erase_if(prepared_, [&](const Prepared& prepared) { return prepared.id == id; });
  const SceneBook& book = shelf_.books().at(id);
  if (book.entry) {
    residency_.note_use(id, now);
    return book.entry;
  }
  if (book.retry_at && now < *book.retry_at)
    return ErrorMessage{ErrorCode::unknown_scene,
                        fmt::format("the scene \"{}\" could not be loaded", name_in(id)), false};
  if (!trees_.form_of(book.found)) {
    if (trees_.given_up(book.found))
      return refusal(SceneResidency::Wish::too_large, id, book.found.size.bytes());
    trees_.order(book.found, true);
    return SceneAwaited{trees_.estimate(book.found)};
  }
  const std::uint64_t bytes = trees_.bytes_of(book.found);
  const auto wish = residency_.want(id, trees_.need_of(book.found), now, in_use_);
  if (wish != SceneResidency::Wish::awaited) return refusal(wish, id, bytes);
  start_next(now);
  const double seconds = static_cast<double>(bytes) / bytes_per_second_;
  return SceneAwaited{std::chrono::seconds(1 + static_cast<std::int64_t>(seconds))};
}

void SceneLibrary::prepare(const std::string& id, TimePoint now) {
  const SceneBook* const book = shelf_.find(id);
  if (!book || book->gone || book->entry || residency_.busy() || making_poster_) return;
  if (!trees_.form_of(book->found)) return;
  std::erase_if(prepared_, [&](const Prepared& other) { return !residency_.resident(other.id); });
  if (prepared_.size() >= most_prepared) {
    const auto [oldest, since] = prepared_.front();
    if (in_use_(oldest) || now - since < std::chrono::seconds(config_.scene_residency_s)) return;
    release(oldest);
    prepared_.erase(prepared_.begin());
  }
  if (!residency_.has_room(trees_.need_of(book->found))) return;
  if (std::holds_alternative<SceneAwaited>(want(id, now))) prepared_.push_back({id, now});
}

void SceneLibrary::want_poster(const std::string& id) {
  boost::asio::post(io_, [this, id] {
    SceneBook* const book = shelf_.find(id);
    if (!book || making_poster_ || residency_.busy()) return;
    const auto form = trees_.form_of(book->found);
    if (!form || book->gone || book->entry || book->poster || book->poster_tried ||
        !residency_.has_room(trees_.need_of(book->found)))
      return;
    making_poster_ = book->poster_tried = true;
    boost::asio::post(loader_, [this, id, form = *form, found = book->found] {
      // The scene goes here, on the loader's thread: that may wait for the device.
      std::shared_ptr<const std::string> poster;
      if (const LoadedScene loaded = load(found, form); loaded.entry) poster = loaded.entry->poster;
      boost::asio::post(io_, [this, id, poster, changed = found.changed] {
        making_poster_ = false;
        SceneBook* const made_for = shelf_.find(id);
        if (!made_for || made_for->found.changed != changed) return;
        if (!made_for->poster) made_for->poster = poster;
        publish();
      });
    });
  });
}

void SceneLibrary::want_ground(const std::string& id) {
  boost::asio::post(io_, [this, id] {
    SceneBook* const book = shelf_.find(id);
    if (!book || !book->entry || book->ground || book->outdated || grounds_.busy()) return;
    if (book->ground_retry_at && clock_() < *book->ground_retry_at) return;
    const GroundSource source = ground_source_of(*book, trees_, config_);
    grounds_.find(id, source,
                  [this, id, source, changed = book->found.changed](const auto& ground) {
                    SceneBook* const found_for = shelf_.find(id);
                    if (!found_for || !found_for->entry || found_for->ground ||
                        found_for->found.changed != changed ||
                        !same_ground(source, ground_source_of(*found_for, trees_, config_)))
                      return;
                    found_for->ground = ground;
                    if (!ground) found_for->ground_retry_at = clock_() + seek_ground_again_after;
                    publish();
                  });
  });
}

void SceneLibrary::on_tick(TimePoint now) {
  std::vector<std::string> outdated;
  for (const auto& [id, book] : shelf_.books()) {
    if (!book.entry || book.pinned) continue;
    if (book.in_use())
      residency_.note_use(id, now);
    else if (book.outdated || book.gone)
      outdated.push_back(id);
  }
  for (const std::string& id : outdated) release(id);
  const auto [too_large, changed] = redrawing_.on_tick(now);
  for (const std::string& id : too_large) release(id);
  if (changed) publish();
  start_next(now);
  metrics_.set_pages(pages_of(shelf_));
  if (next_scan_ && now >= *next_scan_) start_scan(now);
}

void SceneLibrary::start_next(TimePoint now) {
  const auto step = residency_.next(now, in_use_);
  if (!step) return;
  for (const std::string& id : step->release) release(id);
  const FoundScene& found = shelf_.books().at(step->load).found;
  const auto form = trees_.form_of(found);
  if (!form) return residency_.failed(step->load);  // its tree was lost; visitors ask again
  boost::asio::post(loader_, [this, id = step->load, found, form = *form, now] {
    auto loaded = std::make_shared<LoadedScene>(load(found, form));
    boost::asio::post(
        io_, [this, id, loaded, now] { on_loaded(id, std::move(*loaded), now, clock_()); });
  });
}

/// The next scene finds the memory free.
void SceneLibrary::release(const std::string& id) {
  SceneBook& book = shelf_.books().at(id);
  log_info({.event = "scene_released", .scene = id}, "scene {} released", id);
  metrics_.scenes_released.Increment();
  residency_.drop(id);
  auto entry = std::exchange(book.entry, nullptr);
  book.ground.reset();
  book.outdated = book.tree_lost = false;
  if (book.gone) shelf_.books().erase(id);
  publish();
  boost::asio::post(loader_, [entry = std::move(entry)]() mutable { entry.reset(); });
}

LoadedScene SceneLibrary::load(const FoundScene& found, const SceneForm& form) const {
  try {
    // Half of the processors stay free for the visitors' frames.
    const int threads = std::max(1, core_.pool->threads() / 2);
    return {load_scene(
        found.location, form, [&](const auto&) { return found.id; }, config_, core_, threads,
        [this](double) {
          if (stopping_) throw std::runtime_error("the server stops");
        })};
  } catch (const UnusableTree& error) {
    return {nullptr, error.what(), true};
  } catch (const std::exception& error) {
    return {nullptr, error.what()};
  }
}

void SceneLibrary::on_loaded(const std::string& id, LoadedScene loaded, TimePoint started,
                             TimePoint now) {
  SceneBook* const book = shelf_.find(id);
  if (!loaded.entry || !book) {
    residency_.failed(id);
    if (loaded.unusable_tree) {
      if (book) trees_.discard(book->found, loaded.error);
      return start_next(now);  // visitors ask again
    }
    log_error({.event = "scene_load_failed", .scene = id}, "scene {} is not loaded: {}", id,
              loaded.error);
    metrics_.scene_loads_failed.Increment();
    if (book) book->retry_at = now + retry_after_failure;
    return start_next(now);
  }
  const SceneNeed need = need_of(*loaded.entry);
  const double seconds = std::chrono::duration<double>(now - started).count();
  if (!loaded.entry->in_pages)
    bytes_per_second_ =
        std::max(1e6, static_cast<double>(trees_.bytes_of(book->found)) / std::max(seconds, 0.1));
  metrics_.scenes_loaded.Increment();
  residency_.loaded(id, need, now);
  book->entry = std::move(loaded.entry);
  book->ground.reset();
  publish();
  start_next(now);
}

std::shared_ptr<const SceneEntry> SceneLibrary::in_memory(const std::string& id) const {
  const auto it = shelf_.books().find(id);
  return it == shelf_.books().end() ? nullptr : it->second.entry;
}

void SceneLibrary::revise(const std::string& id, std::shared_ptr<const SceneEntry> entry) {
  SceneBook* const book = shelf_.find(id);
  if (!book || !book->entry) return;
  if (book->former && book->former->renderer == entry->renderer)
    entry = redrawn(*entry, *book->entry);
  if (book->entry->renderer != entry->renderer) return;
  const GroundSource before = ground_source_of(*book, trees_, config_);
  book->entry = std::move(entry);
  if (!book->outdated && !same_ground(before, ground_source_of(*book, trees_, config_)))
    book->ground.reset();
  publish();
}

void SceneLibrary::start_scan(TimePoint now) {
  next_scan_ = now + scan_interval;
  if (std::exchange(scanning_, true)) return;
  boost::asio::post(loader_, [this] {
    auto found = std::make_shared<std::optional<std::vector<FoundScene>>>();
    try {
      *found = folders_.scan();
    } catch (const std::exception& error) {  // a missing mount: its scenes stay offered
      log_warning({.event = "scene_folder_unreadable"}, "{}", error.what());
    }
    boost::asio::post(io_, [this, found] {
      scanning_ = false;
      if (*found) merge(**std::move(found));
    });
  });
}

void SceneLibrary::merge(std::vector<FoundScene> found) {
  shelf_.merge(std::move(found), [this](const std::string& id) { return residency_.awaited(id); });
  std::set<std::string> trees;
  for (const auto& [id, book] : shelf_.books())
    if (!book.found.tree.empty()) trees.insert(book.found.tree);
  trees_.keep(trees);
  publish();
}

/// The renderer that was made first.
std::string SceneLibrary::renderer_text() const {
  return shelf_.books().at(shelf_.preferred()).entry->renderer_text;
}

void SceneLibrary::publish() {
  shelf_.publish([this](const FoundScene& found) { return trees_.state_of(found); });
  metrics_.scenes_in_memory.Set(static_cast<double>(residency_.count()));
  metrics_.scene_bytes.Set(static_cast<double>(residency_.bytes()));
}

}  // namespace catgs
