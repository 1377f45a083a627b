#include "server/scenes/scene_trees.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include <boost/asio/post.hpp>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/gaussian_cloud.h"
#include "server/base/log_event.h"
#include "server/base/prompt_thread.h"
#include "server/scenes/tree_builder.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

// A build that fails may have read the whole scene, so it is not tried often.
constexpr auto retry_after_failure = 30min;
constexpr auto progress_interval = 30s;  // of the log
constexpr double assumed_gaussians_per_second = 300e3;
// Of the Gaussians that a build sorts.
constexpr std::uint64_t least_build_bytes = 256'000'000, most_build_bytes = 1'000'000'000;

/// Ends a build from within.
struct Cancelled {};

int percent(double fraction) { return static_cast<int>(100.0 * fraction); }

}  // namespace

SceneTrees::SceneTrees(const ServerConfig& config, int threads, boost::asio::io_context& io,
                       Metrics& metrics, std::function<TimePoint()> clock,
                       std::function<bool(std::uint64_t bytes)> could_fit)
    : config_(config),
      threads_(threads),
      io_(io),
      metrics_(metrics),
      clock_(std::move(clock)),
      could_fit_(std::move(could_fit)) {
  if (config_.cache_dir.empty()) return;
  cache_.emplace(config_.cache_dir);
  builder_.emplace(1);
}

SceneTrees::~SceneTrees() {
  if (running_) running_->cancelled = true;
  if (builder_) builder_->join();
}

bool SceneTrees::ready(const FoundScene& scene) const {
  return cache_ && cache_->contains(scene.tree);
}

bool SceneTrees::deserves_one(const FoundScene& scene) const {
  return !scene.tree.empty() && scene.size.gaussians >= config_.gaussians_of_a_tree;
}

bool SceneTrees::needs_one(const FoundScene& scene) const {
  return !scene.tree.empty() && !could_fit_(scene.size.bytes());
}

std::optional<SceneForm> SceneTrees::form_of(const FoundScene& scene) const {
  SceneForm form;
  if (ready(scene)) {
    form.tree = cache_->path_of(scene.tree);
  } else if (needs_one(scene)) {
    if (!scene.location.has_levels()) return std::nullopt;
    form.most_gaussians = tree_memory(config_) / GaussianCloud::bytes(1, scene.size.sh_degree);
  }
  return form;
}

SceneSize SceneTrees::size_of(const FoundScene& scene) const {
  SceneSize size = scene.size;
  size.in_pages |= ready(scene) || needs_one(scene);
  return size;
}

std::uint64_t SceneTrees::bytes_of(const FoundScene& scene) const {
  return most_bytes(size_of(scene), config_);
}

SceneNeed SceneTrees::need_of(const FoundScene& scene) const {
  // Until its tree is there, a scene that needs one is in memory as a whole, on a coarser level.
  return {bytes_of(scene), scene.size.in_pages || ready(scene)};
}

void SceneTrees::order(const FoundScene& scene, bool urgent) {
  if (given_up(scene)) return;
  if (running_ && !running_->cancelled && running_->scene.tree == scene.tree) {
    running_->urgent |= urgent;
    return;
  }
  const auto known =
      std::ranges::find_if(waiting_, [&](const Order& o) { return o.scene.tree == scene.tree; });
  if (known != waiting_.end() && (known->urgent || !urgent)) return;
  if (known != waiting_.end()) waiting_.erase(known);
  const auto behind = urgent ? std::ranges::find(waiting_, false, &Order::urgent) : waiting_.end();
  waiting_.insert(behind, {scene, urgent});
  changed_ = true;
  // A tree that nobody waits for is built later.
  if (urgent && running_ && !running_->urgent && !running_->cancelled.exchange(true))
    waiting_.push_back({running_->scene, false});
  start_next();
}

void SceneTrees::start_next() {
  if (running_ || waiting_.empty()) return;
  running_ = std::make_shared<Build>();
  running_->scene = std::move(waiting_.front().scene);
  running_->urgent = waiting_.front().urgent;
  running_->started = clock_();
  waiting_.pop_front();
  logged_ = running_->started;
  changed_ = true;
  log_info({.event = "tree_building", .scene = running_->scene.id},
           "scene {}: building its tree from {}", running_->scene.id,
           running_->scene.location.given.string());
  boost::asio::post(*builder_, [this, running = running_] {
    run_in_background();
    std::string error;
    try {
      build(running->scene, [&](double progress) {
        if (running->cancelled) throw Cancelled();
        running->progress = progress;
      });
    } catch (const Cancelled&) {
    } catch (const std::exception& failure) {
      error = failure.what();
    }
    boost::asio::post(io_, [this, known = std::weak_ptr(running), error] {
      if (const auto built = known.lock()) on_built(*built, error);  // else all this has ended
    });
  });
}

void SceneTrees::build(const FoundScene& scene, const std::function<void(double)>& progress) const {
  TreeBuild build;
  build.scene = scene.location;
  build.out = cache_->path_of(scene.tree);
  if (scene.location.has_levels()) build.levels = chosen_levels(config_);
  // A quarter of the memory for scenes.
  build.memory_bytes = std::clamp(tree_memory(config_) / 2, least_build_bytes, most_build_bytes);
  build.threads = threads_;
  build_scene_tree(build, progress);
  if (tree_name(scene.location, build.levels) == scene.tree) return;
  std::error_code error;
  std::filesystem::remove(build.out, error);
  throw InputError(scene.location.given.string(), {}, "changed while its tree was built");
}

void SceneTrees::build_now(const FoundScene& scene) {
  log_info({.event = "tree_building", .scene = scene.id},
           "scene {} does not fit into --scene-memory: building its tree first", scene.id);
  TimePoint logged = clock_();
  build(scene, [&](double progress) {
    if (clock_() - logged < progress_interval) return;
    logged = clock_();
    log_info({.event = "tree_building", .scene = scene.id}, "scene {}: {} % of its tree is built",
             scene.id, percent(progress));
  });
  cache_->add(scene.tree);
  metrics_.trees_built.Increment();
}

void SceneTrees::on_built(const Build& build, const std::string& error) {
  const FoundScene& scene = build.scene;
  cache_->add(scene.tree);
  if (build.cancelled || !error.empty()) cache_->remove(scene.tree);
  if (!build.cancelled && !error.empty()) {
    metrics_.tree_builds_failed.Increment();
    give_up(scene, error);
  } else if (!build.cancelled) {
    metrics_.trees_built.Increment();
    log_info({.event = "tree_built", .scene = scene.id},
             "scene {}: its tree is ready after {:.1f} s", scene.id,
             std::chrono::duration<double>(clock_() - build.started).count());
  }
  running_.reset();
  changed_ = true;
  start_next();
}

std::chrono::seconds SceneTrees::estimate(const FoundScene& scene) const {
  const double gaussians = static_cast<double>(scene.size.gaussians);
  double seconds = gaussians / assumed_gaussians_per_second;
  if (running_ && running_->scene.tree == scene.tree) {
    constexpr double tells_something = 0.02;
    const double done = running_->progress;
    const std::chrono::duration<double> taken = clock_() - running_->started;
    seconds = done >= tells_something ? taken.count() * (1.0 - done) / done : seconds;
  }
  return std::chrono::seconds(1 + static_cast<std::int64_t>(seconds));
}

std::string SceneTrees::state_of(const FoundScene& scene) const {
  if (scene.tree.empty()) return {};
  if (running_ && running_->scene.tree == scene.tree)
    return fmt::format("building tree {} %", percent(running_->progress));
  const bool waits = std::ranges::any_of(
      waiting_, [&](const Order& order) { return order.scene.tree == scene.tree; });
  return waits ? "tree waits to be built" : "";
}

void SceneTrees::discard(const FoundScene& scene, const std::string& why) {
  log_warning({.event = "tree_unusable", .scene = scene.id}, "scene {}: its tree is removed: {}",
              scene.id, why);
  cache_->remove(scene.tree);
  const auto [before, is_first] = discarded_.try_emplace(scene.tree, clock_());
  if (!is_first && clock_() - before->second < retry_after_failure) give_up(scene, why);
  before->second = clock_();
}

void SceneTrees::give_up(const FoundScene& scene, const std::string& why) {
  given_up_[scene.tree] = clock_();
  log_warning({.event = "tree_failed", .scene = scene.id},
              "scene {} has no tree, for at least {} minutes: {}", scene.id,
              retry_after_failure.count(), why);
}

bool SceneTrees::given_up(const FoundScene& scene) const {
  const auto since = given_up_.find(scene.tree);
  return since != given_up_.end() && clock_() - since->second < retry_after_failure;
}

void SceneTrees::keep(const std::set<std::string>& names) {
  if (!cache_) return;
  std::erase_if(waiting_, [&](const Order& order) { return !names.contains(order.scene.tree); });
  std::erase_if(given_up_, [&](const auto& of) { return !names.contains(of.first); });
  std::erase_if(discarded_, [&](const auto& of) { return !names.contains(of.first); });
  if (running_ && !names.contains(running_->scene.tree)) running_->cancelled = true;
  cache_->keep(names);
}

bool SceneTrees::on_tick(TimePoint now) {
  const double progress = running_ ? running_->progress.load() : 0.0;
  if (running_ && now - *logged_ >= progress_interval) {
    logged_ = now;
    log_info({.event = "tree_building", .scene = running_->scene.id},
             "scene {}: {} % of its tree is built", running_->scene.id, percent(progress));
  }
  metrics_.tree_progress.Set(progress);
  changed_ |= std::exchange(told_percent_, percent(progress)) != percent(progress);
  return std::exchange(changed_, false);
}

}  // namespace catgs
