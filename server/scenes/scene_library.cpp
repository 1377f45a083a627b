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
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/tree/page_pools.h"
#include "server/base/log_event.h"
#include "server/base/scene_id.h"
#include "server/scenes/scene_catalog.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto scan_interval = 30s;
constexpr auto retry_after_failure = 30s;

std::vector<std::filesystem::path> paths(const std::vector<std::string>& names) {
  return {names.begin(), names.end()};
}

LoadOptions size_options(const ServerConfig& config) {
  LoadOptions options;
  if (config.lod >= 0) options.lod = config.lod;
  if (config.gaussian_budget > 0)
    options.gaussian_budget = static_cast<std::size_t>(config.gaussian_budget);
  return options;
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

}  // namespace

SceneLibrary::SceneLibrary(const ServerConfig& config, RendererOptions core,
                           boost::asio::io_context& io, Metrics& metrics,
                           std::function<TimePoint()> clock)
    : config_(config),
      core_(std::move(core)),
      io_(io),
      metrics_(metrics),
      clock_(std::move(clock)),
      folders_(paths(config.scene_folders), SceneIds(config.scenes, config.scene_folders),
               size_options(config), keys_of(config.scenes)),
      residency_(residency_limits(config)) {
  core_.pages = std::make_shared<PagePools>(tree_memory(config));
  for (auto& entry : load_scenes(config_, core_)) pin(std::move(entry));
  if (!config_.scene_folders.empty()) open_folders();
  // The first scenes decide whether the server uses GPUs. With GPUs, the processors are reserved
  // for encoding, so a later scene that no GPU can load is refused. Without, pools and budgets
  // count no GPU.
  const bool on_gpus = core_.devices && !core_.devices->views().empty();
  if (core_.kind == RendererKind::automatic)
    core_.kind = on_gpus ? RendererKind::cuda : RendererKind::cpu;
  publish();
}

/// A running server can always show a scene: without others, the folders' first one is loaded.
void SceneLibrary::open_folders() {
  std::vector<FoundScene> found = folders_.scan();
  log_info({.event = "scenes_found"}, "{} scenes in folders, loaded when somebody asks for them",
           found.size());
  merge(std::move(found));
  next_scan_ = clock_() + scan_interval;
  if (!preferred_scene_.empty()) return;
  if (shelf_.empty())
    throw InputError("--scene-folder " + config_.scene_folders.front(), {}, "holds no scene",
                     "put one there, or give --scene");
  const auto& [id, book] = *shelf_.begin();
  const TimePoint now = clock_();
  const auto wish = residency_.want(id, need_of(book), now, in_use());
  if (wish != SceneResidency::Wish::awaited)
    throw InputError("--scene-memory", {}, refusal(wish, id, book).message);
  residency_.next(now, in_use());
  auto entry = read(id, book.found);
  preferred_scene_ = id;
  on_loaded(id, {std::move(entry), {}}, now, clock_());
}

SceneLibrary::~SceneLibrary() {
  stopping_ = true;
  loader_.join();
}

void SceneLibrary::pin(std::shared_ptr<const SceneEntry> entry) {
  const std::string& id = entry->facts.scene_id;
  if (preferred_scene_.empty()) preferred_scene_ = id;
  residency_.pin(id, {entry->renderer->scene_bytes(), entry->in_pages});
  Book& book = book_of(id);
  book.found.name = entry->name;
  book.found.size.gaussians = entry->facts.gaussians;
  book.pinned = true;
  book.entry = std::move(entry);
}

std::string SceneLibrary::default_scene() const {
  const auto preferred = shelf_.find(preferred_scene_);
  if (preferred != shelf_.end() && !preferred->second.gone) return preferred_scene_;
  const auto other = std::ranges::find_if(shelf_, [](const auto& of) { return !of.second.gone; });
  return other != shelf_.end() ? other->first : std::string();
}

std::vector<std::string> SceneLibrary::scene_ids() const {
  std::vector<std::string> ids;
  for (const auto& [id, book] : shelf_)
    if (!book.gone) ids.push_back(id);
  // Newcomers see the default scene first.
  if (const auto it = std::ranges::find(ids, default_scene()); it != ids.end())
    std::rotate(ids.begin(), it, it + 1);
  return ids;
}

/// Scenes come into use on this thread only, so an unused scene stays unused. Uses may end
/// elsewhere without harm.
bool SceneLibrary::Book::in_use() const {
  return entry && (entry.use_count() > 1 || entry->renderer.use_count() > 1);
}

SceneNeed SceneLibrary::need_of(const Book& book) const {
  return {most_bytes(book.found.size, config_), book.found.size.in_pages};
}

SceneResidency::InUse SceneLibrary::in_use() const {
  return [this](const std::string& id) {
    const auto it = shelf_.find(id);
    return it != shelf_.end() && it->second.in_use();
  };
}

SceneAnswer SceneLibrary::want(const std::string& id, TimePoint now) {
  Book& book = shelf_.at(id);
  if (book.entry) {
    residency_.note_use(id, now);
    return book.entry;
  }
  if (book.retry_at && now < *book.retry_at)
    return ErrorMessage{ErrorCode::unknown_scene,
                        fmt::format("the scene \"{}\" could not be loaded", name_in(id)), false};
  const auto wish = residency_.want(id, need_of(book), now, in_use());
  if (wish != SceneResidency::Wish::awaited) return refusal(wish, id, book);
  start_next(now);
  return SceneAwaited{estimate(most_bytes(book.found.size, config_))};
}

ErrorMessage SceneLibrary::refusal(SceneResidency::Wish wish, const std::string& id,
                                   const Book& book) const {
  if (wish == SceneResidency::Wish::too_large)
    return {ErrorCode::unknown_scene,
            fmt::format("the scene \"{}\" takes {}, more than this server has for scenes",
                        name_in(id), megabytes(most_bytes(book.found.size, config_))),
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

void SceneLibrary::want_poster(const std::string& id) {
  boost::asio::post(io_, [this, id] {
    const auto it = shelf_.find(id);
    if (it == shelf_.end() || making_poster_ || residency_.busy()) return;
    Book& book = it->second;
    if (book.gone || book.entry || book.poster || book.poster_tried ||
        !residency_.has_room(need_of(book)))
      return;
    making_poster_ = book.poster_tried = true;
    boost::asio::post(loader_, [this, id, found = book.found] {
      // The scene goes here, on the loader's thread: that may wait for the device.
      std::shared_ptr<const std::string> poster;
      if (const Loaded loaded = load(id, found); loaded.entry) poster = loaded.entry->poster;
      boost::asio::post(io_, [this, id, poster, changed = found.changed] {
        making_poster_ = false;
        const auto made_for = shelf_.find(id);
        if (made_for == shelf_.end() || made_for->second.found.changed != changed) return;
        if (!made_for->second.poster) made_for->second.poster = poster;
        publish();
      });
    });
  });
}

void SceneLibrary::on_tick(TimePoint now) {
  std::vector<std::string> outdated;
  for (const auto& [id, book] : shelf_) {
    if (!book.entry || book.pinned) continue;
    if (book.in_use())
      residency_.note_use(id, now);
    else if (book.outdated || book.gone)
      outdated.push_back(id);
  }
  for (const std::string& id : outdated) release(id);
  start_next(now);
  report_pages();
  if (next_scan_ && now >= *next_scan_) start_scan(now);
}

void SceneLibrary::report_pages() {
  std::vector<ScenePages> all;
  for (const auto& [id, book] : shelf_)
    if (book.entry)
      for (const PageFigures& figures : book.entry->renderer->pages()) all.push_back({id, figures});
  metrics_.set_pages(std::move(all));
}

void SceneLibrary::start_next(TimePoint now) {
  const auto step = residency_.next(now, in_use());
  if (!step) return;
  for (const std::string& id : step->release) release(id);
  boost::asio::post(loader_, [this, id = step->load, found = shelf_.at(step->load).found, now] {
    auto loaded = std::make_shared<Loaded>(load(id, found));
    boost::asio::post(
        io_, [this, id, loaded, now] { on_loaded(id, std::move(*loaded), now, clock_()); });
  });
}

/// Frees scenes on the loader's thread, because that may wait for the device. The next scene then
/// finds the memory free.
void SceneLibrary::release(const std::string& id) {
  Book& book = shelf_.at(id);
  log_info({.event = "scene_released", .scene = id}, "scene {} released", id);
  metrics_.scenes_released.Increment();
  residency_.drop(id);
  auto entry = std::exchange(book.entry, nullptr);
  book.outdated = false;
  if (book.gone) shelf_.erase(id);
  publish();
  boost::asio::post(loader_, [entry = std::move(entry)]() mutable { entry.reset(); });
}

std::shared_ptr<const SceneEntry> SceneLibrary::read(const std::string& id,
                                                     const FoundScene& found) const {
  // Half of the processors stay free for the visitors' frames.
  const int threads = std::max(1, core_.pool->threads() / 2);
  return load_scene(
      found.path.string(), [&](const auto&) { return id; }, config_, core_, threads,
      [this](double) {
        if (stopping_) throw std::runtime_error("the server stops");
      });
}

SceneLibrary::Loaded SceneLibrary::load(const std::string& id, const FoundScene& found) const {
  try {
    return {read(id, found), {}};
  } catch (const std::exception& error) {
    return {nullptr, error.what()};
  }
}

void SceneLibrary::on_loaded(const std::string& id, Loaded loaded, TimePoint started,
                             TimePoint now) {
  const auto it = shelf_.find(id);
  if (!loaded.entry || it == shelf_.end()) {
    log_error({.event = "scene_load_failed", .scene = id}, "scene {} is not loaded: {}", id,
              loaded.error);
    metrics_.scene_loads_failed.Increment();
    residency_.failed(id);
    if (it != shelf_.end()) it->second.retry_at = now + retry_after_failure;
    return start_next(now);
  }
  const SceneNeed need(loaded.entry->renderer->scene_bytes(), loaded.entry->in_pages);
  const double seconds = std::chrono::duration<double>(now - started).count();
  bytes_per_second_ =
      std::max(1e6, static_cast<double>(most_bytes(it->second.found.size, config_)) /
                        std::max(seconds, 0.1));
  metrics_.scenes_loaded.Increment();
  residency_.loaded(id, need, now);
  it->second.entry = std::move(loaded.entry);
  publish();
  start_next(now);
}

std::shared_ptr<const SceneEntry> SceneLibrary::in_memory(const std::string& id) const {
  const auto it = shelf_.find(id);
  return it == shelf_.end() ? nullptr : it->second.entry;
}

void SceneLibrary::revise(const std::string& id, std::shared_ptr<const SceneEntry> entry) {
  const auto it = shelf_.find(id);
  if (it == shelf_.end() || !it->second.entry || it->second.entry->renderer != entry->renderer)
    return;
  it->second.entry = std::move(entry);
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
  for (auto& [id, book] : shelf_) book.gone = !book.pinned;
  for (FoundScene& scene : found) {
    Book& book = book_of(scene.id);
    if (book.pinned) continue;  // --scene names it, too
    book.gone = false;
    if (book.found.changed != scene.changed) {
      book.outdated = book.entry != nullptr;
      book.poster.reset();
      book.poster_tried = false;
      book.retry_at.reset();
    }
    book.found = std::move(scene);
  }
  for (auto& [id, book] : shelf_) {
    const std::string name(name_in(id));
    if (book.pinned || book.told || !by_name_.at(name).empty()) continue;
    book.told = true;
    log_info({.event = "scene_named", .scene = id}, "scene {} is {}, one of several called \"{}\"",
             id, book.found.path.string(), name);
  }
  // Scenes in memory are released first, once they are unused.
  std::vector<std::string> unused;
  for (const auto& [id, book] : shelf_)
    if (book.gone && !book.entry && !residency_.awaited(id)) unused.push_back(id);
  for (const std::string& id : unused) shelf_.erase(id);
  publish();
}

SceneLibrary::Book& SceneLibrary::book_of(const std::string& id) {
  const auto [book, is_new] = shelf_.try_emplace(id);
  if (is_new) {
    const std::lock_guard lock(published_mutex_);
    const auto [known, first] = by_name_.try_emplace(std::string(name_in(id)), id);
    if (!first && known->second != id) known->second.clear();
  }
  return book->second;
}

std::string SceneLibrary::resolve(std::string_view wish) const {
  if (!belongs_to_path(wish)) {
    const std::lock_guard lock(published_mutex_);
    if (const auto known = by_name_.find(wish); known != by_name_.end() && !known->second.empty())
      return known->second;
  }
  return std::string(wish);
}

std::chrono::seconds SceneLibrary::estimate(std::uint64_t bytes) const {
  const auto seconds = static_cast<double>(bytes) / bytes_per_second_;
  return std::chrono::seconds(1 + static_cast<std::int64_t>(seconds));
}

void SceneLibrary::publish() {
  auto listing = std::make_shared<std::vector<Listing>>();
  for (const std::string& id : scene_ids()) {
    Book& book = shelf_.at(id);
    if (book.entry && !book.outdated) {
      book.found.about = book.entry->facts.about;
      book.poster = book.entry->poster;
    }
    const FoundScene& found = book.found;
    listing->push_back({.id = id,
                        .title = found.about.title.empty() ? found.name : found.about.title,
                        .gaussians = found.size.gaussians,
                        .about = found.about,
                        .loaded = book.entry != nullptr,
                        .poster = book.poster});
    if (book.entry) listing->back().tours = book.entry->tours;
  }
  metrics_.scenes_in_memory.Set(static_cast<double>(residency_.count()));
  metrics_.scene_bytes.Set(static_cast<double>(residency_.bytes()));
  const std::lock_guard lock(published_mutex_);
  published_ = std::move(listing);
}

std::string SceneLibrary::renderer_text() const {
  return shelf_.at(preferred_scene_).entry->renderer_text;
}

std::shared_ptr<const std::vector<SceneLibrary::Listing>> SceneLibrary::listing() const {
  const std::lock_guard lock(published_mutex_);
  return published_;
}

}  // namespace catgs
