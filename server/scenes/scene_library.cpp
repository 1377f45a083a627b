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
#include "server/scenes/scene_refusal.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto scan_interval = 30s;
constexpr auto retry_after_failure = 30s;
constexpr auto seek_ground_again_after = 5min;
constexpr std::size_t most_prepared = 2;

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

/// A quarter of the processors. Trees are built while visitors look.
int builder_threads(const RendererOptions& core) { return std::max(1, core.pool->threads() / 4); }

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
      io_(io),
      metrics_(metrics),
      clock_(std::move(clock)),
      trees_(config, builder_threads(core), io, metrics, clock_,
             [this](std::uint64_t bytes) { return residency_.could_fit(bytes); }),
      look_{SceneIds(config.scenes, config.scene_folders), chosen_levels(config), trees_.enabled()},
      loads_(config_, core, look_.ids, trees_),
      folders_({config.scene_folders.begin(), config.scene_folders.end()}, look_,
               keys_of(config.scenes)),
      residency_(residency_limits(config)),
      use_of_([this](const std::string& id) {
        const SceneBook* const book = shelf_.find(id);
        return book ? book->use() : SceneUse::none;
      }),
      redrawing_(
          shelf_, trees_, residency_, io, loader_,
          [this](const auto& found, const auto& form) { return loads_.load(found, form, false); }),
      posters_(
          shelf_, trees_, residency_, io, loader_,
          [this](const auto& found, const auto& form) { return loads_.load(found, form, true); },
          [this] { publish(); }),
      grounds_(config.cache_dir, builder_threads(core), io) {
  pin_scenes();
  if (config_.scene_folders.empty())
    merge({});
  else
    open_folders();
  loads_.keep_core();
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
    auto entry = loads_.load_now(found);
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
  const auto wish = residency_.want(id, trees_.need_of(found), now, use_of_);
  if (wish != SceneResidency::Wish::awaited)
    throw InputError("--scene-memory", {}, refusal(wish, id, trees_.bytes_of(found)).message);
  residency_.next(now, use_of_);
  auto entry = loads_.load_now(found);
  shelf_.prefer(id);
  on_loaded(id, {std::move(entry)}, now, clock_());
}

SceneLibrary::~SceneLibrary() {
  loads_.stop();
  loader_.join();
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
  const auto wish = residency_.want(id, trees_.need_of(book.found), now, use_of_);
  if (wish != SceneResidency::Wish::awaited) {
    if (redrawing_.holds_two_forms()) return SceneAwaited{1s};  // one of them goes soon
    return refusal(wish, id, bytes);
  }
  if (residency_.visitor_waits() && (residency_.loads_in_background() || posters_.busy()))
    loads_.give_way();
  start_next(now);
  const double seconds = static_cast<double>(bytes) / bytes_per_second_;
  return SceneAwaited{std::chrono::seconds(1 + static_cast<std::int64_t>(seconds))};
}

void SceneLibrary::prepare(const std::string& id, TimePoint now) {
  const SceneBook* const book = shelf_.find(id);
  if (!book || book->gone || book->entry || residency_.busy() || posters_.busy()) return;
  if (!trees_.form_of(book->found)) return;
  std::erase_if(prepared_, [&](const Prepared& other) { return !residency_.resident(other.id); });
  if (prepared_.size() >= most_prepared) {
    const auto [oldest, since] = prepared_.front();
    if (use_of_(oldest) != SceneUse::none ||
        now - since < std::chrono::seconds(config_.scene_residency_s))
      return;
    release(oldest);
    prepared_.erase(prepared_.begin());
  }
  if (!residency_.has_room(trees_.need_of(book->found))) return;
  if (std::holds_alternative<SceneAwaited>(want(id, now))) prepared_.push_back({id, now});
}

void SceneLibrary::want_poster(const std::string& id) {
  boost::asio::post(io_, [this, id] {
    if (!posters_.busy() && !residency_.busy()) loads_.begin_in_background();
    posters_.want(id);
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
    const SceneUse use = book.use();
    if (use != SceneUse::none) residency_.note_use(id, now);
    if (use == SceneUse::visitors || !(book.outdated || book.gone)) continue;
    if (use == SceneUse::background)
      book.recall();
    else
      outdated.push_back(id);
  }
  for (const std::string& id : outdated) release(id);
  const auto [too_large, changed] = redrawing_.on_tick(now);
  for (const std::string& id : too_large) release(id);
  if (changed) publish();
  start_next(now);
  metrics_.set_pages(shelf_.pages());
  if (next_scan_ && now >= *next_scan_) start_scan();
}

void SceneLibrary::start_next(TimePoint now) {
  const auto step = residency_.next(now, use_of_);
  if (!step) return;
  for (const std::string& id : step->recall) shelf_.books().at(id).recall();
  if (step->recall.empty()) carry_out(*step, false, now);
}

void SceneLibrary::carry_out(const SceneResidency::Step& step, bool gives_way, TimePoint now) {
  for (const std::string& id : step.release) release(id);
  const FoundScene& found = shelf_.books().at(step.load).found;
  const auto form = trees_.form_of(found);
  if (!form) return residency_.failed(step.load);  // its tree was lost; visitors ask again
  boost::asio::post(loader_, [this, id = step.load, found, form = *form, gives_way, now] {
    auto loaded = std::make_shared<LoadedScene>(loads_.load(found, form, gives_way));
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

void SceneLibrary::on_loaded(const std::string& id, LoadedScene loaded, TimePoint started,
                             TimePoint now) {
  SceneBook* const book = shelf_.find(id);
  if (!loaded.entry || !book) {
    residency_.failed(id);
    if (loaded.gave_way) return start_next(now);
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

LeasedScene SceneLibrary::lease(const std::string& id, bool again) {
  const SceneBook* const book = shelf_.find(id);
  if (!book) return {.gone = true};
  const LeasedScene none{.gone = book->gone};
  if (in_memory(id)) {
    // While a visitor needs the room, no scene is held that visitors have left.
    const bool leaves = book->outdated || book->gone || residency_.visitor_waits();
    return leaves && !book->pinned && book->use() != SceneUse::visitors ? none : book->lease();
  }
  const TimePoint now = clock_();
  if (!again || book->gone || posters_.busy() || (book->retry_at && now < *book->retry_at) ||
      !trees_.form_of(book->found))
    return none;
  const auto step = residency_.next_in_background(id, trees_.need_of(book->found), now, use_of_);
  if (!step) return none;
  loads_.begin_in_background();
  carry_out(*step, true, now);
  return none;
}

void SceneLibrary::revise(const std::string& id, std::shared_ptr<const SceneEntry> entry) {
  SceneBook* const book = shelf_.find(id);
  if (!book || !book->entry) return;
  if (book->former && book->former->renderer == entry->renderer)
    entry = redrawn(*entry, *book->entry);
  if (book->entry->renderer != entry->renderer) return;
  const GroundSource before = ground_source_of(*book, trees_, config_);
  book->entry = unleased(std::move(entry), book->entry->renderer);
  if (!book->outdated && !same_ground(before, ground_source_of(*book, trees_, config_)))
    book->ground.reset();
  publish();
}

void SceneLibrary::start_scan() {
  next_scan_.reset();
  boost::asio::post(loader_, [this] {
    auto found = std::make_shared<std::optional<std::vector<FoundScene>>>();
    try {
      *found = folders_.scan();
    } catch (const std::exception& error) {  // a missing mount: its scenes stay offered
      log_warning({.event = "scene_folder_unreadable"}, "{}", error.what());
    }
    boost::asio::post(io_, [this, found] {
      next_scan_ = clock_() + scan_interval;
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
