// catgs-render info: the content of a scene, and the first view of it.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/resource.h>

#include "render_core/base/even_sample.h"
#include "render_core/scene/analysis/robust_bounds.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/files/tour_check.h"
#include "render_core/scene/scene.h"
#include "render_core/scene/tree/read_tree.h"
#include "render_core/scene/tree/tree_file.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/json_report.h"
#include "render_core/tools/render/tree_output.h"
#include "render_core/tools/scene_options.h"

namespace catgs {
namespace {

using Json = nlohmann::ordered_json;

struct InfoOptions {
  SceneOptions scene;
  int threads = 0;
  bool json = false;
};

Json triple(const glm::vec3& v) { return {v.x, v.y, v.z}; }

/// Quantiles of value(i) over an even sample of the Gaussians.
template <class Value>
Json quantiles(const GaussianCloud& cloud, const Value& value) {
  const EvenSample even(cloud.size(), 1 << 20);
  std::vector<float> values;
  for (std::size_t k = 0; k < even.size(); ++k) values.push_back(value(even[k]));
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
  };
  return {{"p5", at(0.05)}, {"p50", at(0.5)}, {"p95", at(0.95)}, {"max", values.back()}};
}

Json describe(const Scene& scene, double load_ms) {
  const GaussianCloud& cloud = scene.cloud;
  const Bounds bounds = robust_bounds(cloud).value_or(Bounds{});
  const SanitizeReport& report = scene.report;
  const SceneHints& hints = scene.hints;
  const glm::quat& q = hints.start_pose.orientation;
  const auto position = [&](const glm::vec3& p) { return json_location(p, hints.origin); };
  const auto largest = [&](std::size_t i) {
    return std::max({cloud.scale[i].x, cloud.scale[i].y, cloud.scale[i].z});
  };
  const auto smallest = [&](std::size_t i) {
    return std::min({cloud.scale[i].x, cloud.scale[i].y, cloud.scale[i].z});
  };
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return {
      {"name", scene.name},
      {"format", scene.format},
      {"gaussians", cloud.size()},
      {"model", name_of(cloud.model)},
      {"sh_degree", cloud.sh_degree},
      {"bytes", cloud.bytes()},
      {"robust_bounds", {{"min", position(bounds.min)}, {"max", position(bounds.max)}}},
      {"origin", {hints.origin.x, hints.origin.y, hints.origin.z}},
      {"opacity", quantiles(cloud, [&](std::size_t i) { return cloud.opacity[i]; })},
      {"largest_scale", quantiles(cloud, largest)},
      {"flatness", quantiles(cloud, [&](std::size_t i) { return largest(i) / smallest(i); })},
      {"sanitize",
       {{"read", report.read},
        {"dropped", report.dropped},
        {"not_finite", report.not_finite},
        {"invisible", report.invisible},
        {"absurd", report.absurd},
        {"repaired", report.repaired},
        {"zero_rotations", report.zero_rotations},
        {"clamped", report.clamped},
        {"zeroed_sh", report.zeroed_sh}}},
      {"hints",
       {{"source", hints.source},
        {"up", triple(hints.up)},
        {"start_position", position(hints.start_pose.position)},
        {"start_orientation_xyzw", {q.x, q.y, q.z, q.w}},
        {"focus", position(hints.focus)},
        {"near", hints.near_z},
        {"scale", hints.scale},
        {"limits", {{"min", position(hints.limits.min)}, {"max", position(hints.limits.max)}}}}},
      {"notes", scene.notes},
      {"load_ms", load_ms},
      {"peak_rss_bytes", static_cast<std::int64_t>(usage.ru_maxrss) * 1024}};
}

std::string point(const Json& v) {
  const auto number = [&](std::size_t k) {
    const auto value = v[k].get<double>();
    return std::abs(value) < 1000.0 ? fmt::format("{:.4g}", value) : fmt::format("{:.1f}", value);
  };
  return fmt::format("{} {} {}", number(0), number(1), number(2));
}

std::string spread(const Json& q) {
  return fmt::format("{:.3g} … {:.3g} … {:.3g}, at most {:.3g}", q["p5"].get<double>(),
                     q["p50"].get<double>(), q["p95"].get<double>(), q["max"].get<double>());
}

void print_notes(const Json& info) {
  for (const Json& note : info["notes"]) fmt::print("{:<16}{}\n", "note", note.get<std::string>());
}

void print_text(const Json& info) {
  const auto line = [](std::string_view label, const std::string& value) {
    fmt::print("{:<16}{}\n", label, value);
  };
  const auto count = [](const Json& n) { return n.get<std::size_t>(); };
  const double bytes = info["bytes"].get<double>(), peak = info["peak_rss_bytes"].get<double>();
  const Json &report = info["sanitize"], &hints = info["hints"];
  line("scene", info["name"].get<std::string>());
  line("format", info["format"].get<std::string>());
  line("model", info["model"].get<std::string>());
  line("Gaussians", fmt::format("{}, SH degree {}, {:.1f} MB", count(info["gaussians"]),
                                info["sh_degree"].get<int>(), 1e-6 * bytes));
  line("5–95 % bounds", fmt::format("{}  to  {}", point(info["robust_bounds"]["min"]),
                                    point(info["robust_bounds"]["max"])));
  line("opacity", spread(info["opacity"]) + "  (5, 50, 95 %)");
  line("largest scale", spread(info["largest_scale"]));
  line("flatness", spread(info["flatness"]) + "  (largest / smallest scale)");
  line("dropped",
       fmt::format("{} of {}: {} not finite, {} invisible, {} absurd", count(report["dropped"]),
                   count(report["read"]), count(report["not_finite"]), count(report["invisible"]),
                   count(report["absurd"])));
  line("repaired", fmt::format("{}: {} zero rotations, {} clamped, {} with bad SH",
                               count(report["repaired"]), count(report["zero_rotations"]),
                               count(report["clamped"]), count(report["zeroed_sh"])));
  line("first view", hints["source"].get<std::string>());
  line("  up", point(hints["up"]));
  line("  start",
       fmt::format("{}  looking at  {}", point(hints["start_position"]), point(hints["focus"])));
  line("  near plane", fmt::format("{:.4g}", hints["near"].get<double>()));
  line("  scale", fmt::format("{:.4g}", hints["scale"].get<double>()));
  line("  limits",
       fmt::format("{}  to  {}", point(hints["limits"]["min"]), point(hints["limits"]["max"])));
  print_notes(info);
  line("loaded in", fmt::format("{:.0f} ms, peak memory {:.1f} MB ({:.2f} x the scene)",
                                info["load_ms"].get<double>(), 1e-6 * peak, peak / bytes));
}

void info(const InfoOptions& options, bool quiet) {
  const SceneLocation location = locate_scene(options.scene.path);
  std::vector<std::string> notes;
  if (auto mistake = mistake_for_pages(location.hints)) notes.push_back(*std::move(mistake));
  if (location.is_in_pages()) {
    TreeFile tree(std::make_unique<FileSource>(location.files.path));
    require_root(tree);
    Json description = describe_tree(location.files.path, tree.header());
    description["notes"] = notes;
    if (options.json) return write_json("-", description);
    print_tree(description);
    return print_notes(description);
  }
  const auto start = std::chrono::steady_clock::now();
  Scene scene = load_scene(location, options.scene, options.threads, quiet);
  const std::chrono::duration<double, std::milli> load_ms =
      std::chrono::steady_clock::now() - start;
  scene.notes.insert(scene.notes.end(), notes.begin(), notes.end());
  const Json description = describe(scene, load_ms.count());
  if (options.json)
    write_json("-", description);
  else
    print_text(description);
}

}  // namespace

void add_info_command(CLI::App& app) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* command = app.add_subcommand("info", "Describes a scene: content, defects, first view");
  add_scene_options(*command, options->scene);
  command->add_option("--threads", options->threads, "0: one per processor")->capture_default_str();
  command->add_flag("--json", options->json, "Print JSON, with lengths in world units");
  command->callback([options, command] { info(*options, is_quiet(*command)); });
}

}  // namespace catgs
