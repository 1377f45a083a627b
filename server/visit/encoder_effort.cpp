#include "server/visit/encoder_effort.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr double busy_share = 0.6;
constexpr double calm_share = 0.4;
constexpr auto busy_for = 1s;
constexpr double encoding_part = 0.4;  // of the busy time
constexpr double too_long = 0.55;      // of the frame interval
constexpr double relieved_share = 0.5;
constexpr double roomy_share = 0.25;
// Enough for 60 pictures a second with the fastest preset: 6 ms for a million pixels.
constexpr double usual_cpus_per_pixel = 60 * 6e-9;
constexpr double comfortable = 0.4;
constexpr auto settle = 1s;  // until a change shows in the measurements
constexpr auto proof = 30s;
constexpr auto most_patience = 120s;

constexpr int least_pixels_cut = 1'000'000;  // less takes one processor 5 ms

double cost_ratio(int from, int to) {
  return effort_presets[static_cast<std::size_t>(to)].cost /
         effort_presets[static_cast<std::size_t>(from)].cost;
}

}  // namespace

void apply(const EncoderEffort& effort, EncoderSettings& settings) {
  settings.x264_preset = effort_presets[static_cast<std::size_t>(effort.preset)].name;
  settings.threads = effort.threads;
}

int EffortControl::threads_for(int sessions, glm::ivec2 size_px) const {
  if (presets_.threads > 0) return presets_.threads;
  if (size_px.x * size_px.y < least_pixels_cut) return 1;
  return std::clamp(static_cast<int>(std::ceil(cpus_ / std::max(1, sessions))), 1, max_h264_slices);
}

EncoderEffort EffortControl::initial(int sessions, glm::ivec2 size_px) const {
  const double pixels = static_cast<double>(size_px.x) * size_px.y;
  // When many newcomers arrive together, the cost of the latest is not measured yet.
  const bool known = measured_ > 0 && 2 * measured_ >= sessions - 1;
  const double cost = known ? cpus_per_pixel_ * pixels * (sessions - measured_) / cpus_
                            : usual_cpus_per_pixel * pixels * sessions / cpus_;
  const double before = known ? busy_ : 0.0;
  int preset = presets_.highest;
  while (preset > presets_.lowest && before + cost * cost_ratio(0, preset) > roomy_share) --preset;
  return {preset, threads_for(sessions, size_px)};
}

void EffortControl::note_costs(double busy, std::span<const Session> sessions) {
  busy_ = busy;
  measured_ = static_cast<int>(sessions.size());
  double cpus = 0, pixels = 0;
  for (const Session& session : sessions) {
    cpus += session.cpus / cost_ratio(0, session.effort.preset);
    pixels += static_cast<double>(session.size_px.x) * session.size_px.y;
  }
  cpus_per_pixel_ = pixels > 0 ? cpus / pixels : 0;
}

std::vector<EffortControl::Change> EffortControl::update(double busy, int admitted,
                                                         std::span<const Session> sessions,
                                                         TimePoint now) {
  note_costs(busy, sessions);
  busy_since_ = held_since(busy_since_, busy >= busy_share, now);
  calm_since_ = held_since(calm_since_, busy <= calm_share, now);
  if (within(changed_, settle, now)) return {};
  std::vector<Change> changes;
  if (changes = faster(busy, admitted, sessions, now); !changes.empty()) {
    patience_ = within(slowed_, proof, now)
                    ? std::min<std::chrono::seconds>(2 * patience_, most_patience)
                    : least_patience;
  } else if (const auto recut = with_other_threads(admitted, sessions)) {
    changes = {*recut};
  } else if (held_for(calm_since_, patience_, now)) {
    if (const auto better = slower(busy, sessions)) {
      changes = {*better};
      slowed_ = now;
    }
  }
  if (!changes.empty()) changed_ = now;
  return changes;
}

std::optional<EffortControl::Change> EffortControl::with_other_threads(
    int admitted, std::span<const Session> sessions) const {
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    const Session& session = sessions[i];
    const int threads = threads_for(admitted, session.size_px);
    if (threads != session.effort.threads) return Change{i, {session.effort.preset, threads}};
  }
  return std::nullopt;
}

std::vector<EffortControl::Change> EffortControl::faster(double busy, int admitted,
                                                         std::span<const Session> sessions,
                                                         TimePoint now) const {
  const double encoding =
      std::transform_reduce(sessions.begin(), sessions.end(), 0.0, std::plus(),
                            [](const Session& session) { return session.cpus; });
  const bool relieve =
      held_for(busy_since_, busy_for, now) && encoding >= encoding_part * busy * cpus_;
  std::vector<std::size_t> costliest_first(sessions.size());
  std::iota(costliest_first.begin(), costliest_first.end(), std::size_t{0});
  std::ranges::sort(costliest_first, std::ranges::greater(),
                    [&](std::size_t i) { return sessions[i].cpus; });
  std::vector<Change> changes;
  const std::size_t most = (sessions.size() + 1) / 2;
  for (const std::size_t i : costliest_first) {
    const Session& session = sessions[i];
    const int preset = session.effort.preset;
    if (preset <= presets_.lowest) continue;
    const bool late = session.share_of_interval >= too_long;
    if (!late && !(relieve && busy > relieved_share)) continue;
    changes.push_back({i, {preset - 1, threads_for(admitted, session.size_px)}});
    if (changes.size() == most) break;
    busy -= session.cpus * (1.0 - cost_ratio(preset, preset - 1)) / cpus_;
  }
  return changes;
}

std::optional<EffortControl::Change> EffortControl::slower(
    double busy, std::span<const Session> sessions) const {
  std::optional<std::size_t> fastest;
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    const Session& session = sessions[i];
    const int preset = session.effort.preset;
    if (preset >= presets_.highest) continue;
    const double ratio = cost_ratio(preset, preset + 1);
    if (busy + session.cpus * (ratio - 1.0) / cpus_ > calm_share ||
        session.share_of_interval * ratio > comfortable)
      continue;
    if (!fastest || preset < sessions[*fastest].effort.preset) fastest = i;
  }
  if (!fastest) return std::nullopt;
  const EncoderEffort& effort = sessions[*fastest].effort;
  return Change{*fastest, {effort.preset + 1, effort.threads}};
}

}  // namespace catgs
