#include "server/scenes/scene_trees.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/math/axis_name.h"
#include "render_core/scene/gaussian_cloud.h"
#include "server/base/log_event.h"
#include "server/scenes/kept_views.h"
#include "server/scenes/tree_builder.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

// A build that fails may have read the whole scene, so it is not tried often.
constexpr auto retry_after_failure = 30min;
constexpr auto progress_interval = 30s;  // of the log
constexpr double assumed_gaussians_per_second = 300e3;
// The memory for the Gaussians that a build sorts.
constexpr std::uint64_t least_build_bytes = 256'000'000, most_build_bytes = 1'000'000'000;

int percent(double fraction) { return static_cast<int>(100.0 * fraction); }

}  // namespace

SceneTrees::SceneTrees(const ServerConfig& config, DerivedFiles* cache, int threads,
                       Background& background, boost::asio::io_context& io, Metrics& metrics,
                       std::function<TimePoint()> clock,
                       std::function<bool(std::uint64_t bytes)> could_fit)
    : config_(config),
      threads_(threads),
      metrics_(metrics),
      clock_(std::move(clock)),
      could_fit_(std::move(could_fit)),
      cache_(cache),
      choices_(cache, config_),
      jobs_(background, io) {}

bool SceneTrees::ready(const FoundScene& scene) const {
  return cache_ && cache_->contains(scene.tree);
}

bool SceneTrees::deserves_one(const FoundScene& scene) const {
  return !scene.tree.empty() && scene.size.gaussians >= config_.gaussians_of_a_tree;
}

bool SceneTrees::needs_one(const FoundScene& scene) const {
  return !scene.tree.empty() && !could_fit_(scene.size.bytes());
}

bool SceneTrees::is_drawn_from_tree(const FoundScene& scene) const {
  return ready(scene) && !(has_other(scene) && choices_.of(scene) == TreeChoices::Choice::without);
}

bool SceneTrees::undecided(const FoundScene& scene) const {
  return ready(scene) && has_other(scene) && choices_.of(scene) == TreeChoices::Choice::unknown;
}

std::optional<SceneRepresentation> SceneTrees::representation_of(const FoundScene& scene,
                                                                 bool from_tree) const {
  SceneRepresentation representation;
  if (from_tree && is_drawn_from_tree(scene)) {
    representation.tree = cache_->path_of(scene.tree);
  } else if (needs_one(scene)) {
    if (!scene.location.has_levels()) return std::nullopt;
    representation.most_gaussians =
        tree_memory(config_) / GaussianCloud::bytes(1, scene.size.sh_degree);
  }
  return representation;
}

std::uint64_t SceneTrees::bytes_of(const FoundScene& scene, bool from_tree) const {
  SceneSize size = scene.size;
  size.in_pages |= (from_tree && is_drawn_from_tree(scene)) || needs_one(scene);
  return most_bytes(size, config_);
}

SceneNeed SceneTrees::need_of(const FoundScene& scene, bool from_tree) const {
  // Without its tree, a scene that needs one is in memory as a whole, on a coarser level.
  return {bytes_of(scene, from_tree),
          scene.size.in_pages || (from_tree && is_drawn_from_tree(scene))};
}

void SceneTrees::order(const FoundScene& scene, bool urgent) {
  if (given_up(scene)) return;
  const Priority priority = urgent ? Priority::high : Priority::low;
  SharedBuild& known = builds_[scene.tree];
  if (known && urgent) jobs_.set_priority(known->job, priority);
  if (known) return;
  const SharedBuild ordered = known = std::make_shared<Build>();
  ordered->scene = scene;
  changed_ = true;
  ordered->job = jobs_.start_then(
      lanes.trees, priority,
      [this, ordered](const std::stop_token& stop) {
        log_info({.event = "tree_building", .scene = ordered->scene.id},
                 "scene {}: building its tree from {}", ordered->scene.id,
                 ordered->scene.location.given.string());
        const TimePoint started = Clock::now();
        ordered->progress = 0.0;
        ordered->begun = true;
        try {
          build(ordered->scene, [&](double progress) {
            throw_if_stopped(stop);
            ordered->progress = progress;
          });
        } catch (...) {
          ordered->begun = false;  // it may start anew
          throw;
        }
        ordered->begun = false;
        return Clock::now() - started;
      },
      [this, ordered](const Finished<Clock::duration>& built) { on_built(ordered, built); });
}

void SceneTrees::build(const FoundScene& scene, const std::function<void(double)>& progress) const {
  TreeBuild build;
  build.scene = scene.location;
  build.out = cache_->path_of(scene.tree);
  if (scene.location.has_levels()) build.levels = chosen_levels(config_);
  build.up = axis_named(config_.up);
  build.keep_view = keep_view(cache_, scene.location, config_);
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

void SceneTrees::on_built(const SharedBuild& build, const Finished<Clock::duration>& built) {
  const FoundScene& scene = build->scene;
  const auto known = builds_.find(scene.tree);
  const bool wanted = known != builds_.end() && known->second == build;
  if (wanted) builds_.erase(known);
  changed_ = true;
  if (!built.error.empty()) {
    metrics_.tree_builds_failed.Increment();
    if (wanted) give_up(scene, built.error);
  } else if (built.result) {
    cache_->add(scene.tree);
    if (!wanted) return;
    metrics_.trees_built.Increment();
    log_info({.event = "tree_built", .scene = scene.id},
             "scene {}: its tree is ready after {:.1f} s", scene.id,
             std::chrono::duration<double>(*built.result).count());
  }
}

SceneTrees::SharedBuild SceneTrees::running() const {
  const auto build =
      std::ranges::find_if(builds_, [](const auto& of) { return of.second->begun.load(); });
  return build == builds_.end() ? nullptr : build->second;
}

std::chrono::seconds SceneTrees::estimate(const FoundScene& scene) const {
  const double gaussians = static_cast<double>(scene.size.gaussians);
  double seconds = gaussians / assumed_gaussians_per_second;
  const SharedBuild build = running();
  if (build && build->started && build->scene.tree == scene.tree) {
    constexpr double tells_something = 0.02;
    const double done = build->progress;
    const std::chrono::duration<double> taken = clock_() - *build->started;
    seconds = done >= tells_something ? taken.count() * (1.0 - done) / done : seconds;
  }
  return std::chrono::seconds(1 + static_cast<std::int64_t>(seconds));
}

std::string SceneTrees::state_of(const FoundScene& scene) const {
  const auto build = builds_.find(scene.tree);
  if (build == builds_.end()) return {};
  if (!build->second->begun) return "tree waits to be built";
  return fmt::format("building tree {} %", percent(build->second->progress));
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
  std::erase_if(builds_, [&](const auto& of) {
    if (names.contains(of.first)) return false;
    jobs_.cancel(of.second->job);
    return true;
  });
  choices_.keep(names);
  std::erase_if(given_up_, [&](const auto& of) { return !names.contains(of.first); });
  std::erase_if(discarded_, [&](const auto& of) { return !names.contains(of.first); });
  cache_->keep(names);
}

bool SceneTrees::on_tick(TimePoint now) {
  const SharedBuild build = running();
  const double progress = build ? build->progress.load() : 0.0;
  for (const auto& [name, other] : builds_)
    if (other != build) other->started.reset();  // it may have to start anew
  if (build && !build->started) build->started = build->logged = now;
  if (build && now - *build->logged >= progress_interval) {
    build->logged = now;
    log_info({.event = "tree_building", .scene = build->scene.id},
             "scene {}: {} % of its tree is built", build->scene.id, percent(progress));
  }
  metrics_.tree_progress.Set(progress);
  changed_ |= std::exchange(told_percent_, percent(progress)) != percent(progress);
  return std::exchange(changed_, false);
}

}  // namespace catgs
