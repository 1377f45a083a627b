#include "tests/load/chart_document.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/build_info.h"
#include "render_core/base/error.h"
#include "server/net/static_files.h"
#include "tests/load/report.h"

namespace catgs::load {
namespace {

using Json = nlohmann::ordered_json;

/// A curve without points. A NaN is written as null, which interrupts the curve.
Json curve(const std::string& name) {
  return {{"name", name}, {"x", Json::array()}, {"y", Json::array()}};
}

void add_point(Json& curve, double x, double y) {
  curve["x"].push_back(x);
  curve["y"].push_back(y);
}

Json requirement_table(const Outcome& outcome) {
  Json rows = Json::array();
  for (const Requirement& requirement : outcome.requirements)
    rows.push_back({requirement.text(), requirement.value(outcome.metrics),
                    requirement.holds(outcome.metrics) ? "holds" : "does not hold"});
  return {{"columns", {"requirement", "value", ""}}, {"rows", std::move(rows)}};
}

Json group_table(const RunReport& report, const HoldBounds& bounds) {
  Json columns = Json::array({"group"}), rows = Json::array();
  constexpr std::array names = {"sessions_connected",
                                "fps_min",
                                "fps_mean",
                                "fps_max",
                                "bitrate_kbps_mean",
                                "pose_to_frame_p50_ms",
                                "pose_to_frame_p95_ms",
                                "pose_to_frame_p99_ms",
                                "pose_age_p95_ms",
                                "psnr_mean_db",
                                "sessions_held",
                                "errors"};
  for (const char* name : names) columns.push_back(name);
  for (const GroupReport& group : report.groups) {
    const Metrics metrics = collect_metrics(group.sessions, group.nominal_fps, bounds);
    Json& row = rows.emplace_back(Json::array({group.name}));
    for (const char* name : names) row.push_back(value_of(metrics, name));
  }
  return {{"columns", std::move(columns)}, {"rows", std::move(rows)}};
}

/// One curve a group: `value` of each bin.
template <typename Value>
Json over_time(const Scenario& scenario, const RunReport& report, std::optional<double> bound,
               Value value) {
  const double end_s = scenario.load.duration_s;
  Json curves = Json::array();
  for (const GroupReport& group : report.groups) {
    Json& of_group = curves.emplace_back(curve(group.name));
    const auto& bins = group.series->bins();
    for (std::size_t i = 0; i < bins.size(); ++i) {
      // The last frames come a moment after the end.
      if (static_cast<double>(i) * group.series->bin_s() >= end_s) break;
      add_point(of_group, (static_cast<double>(i) + 0.5) * group.series->bin_s(),
                value(group, bins[i]));
    }
  }
  if (bound)
    curves.push_back(
        {{"name", "bound"}, {"x", {0.0, end_s}}, {"y", {*bound, *bound}}, {"bound", true}});
  return curves;
}

Json time_plots(const Scenario& scenario, const RunReport& report) {
  Json plots = Json::array();
  const auto add = [&](const char* title, const char* unit, std::optional<double> bound,
                       auto value) {
    plots.push_back(
        {{"title", title}, {"unit", unit}, {"curves", over_time(scenario, report, bound, value)}});
  };
  const auto per_session = [](const GroupReport& group, double sum) {
    return sum / (group.series->bin_s() * static_cast<double>(group.sessions.size()));
  };
  add("Pose sent to frame received, p95", "ms", scenario.bounds.pose_to_frame_p95_ms,
      [](const auto&, const SeriesBin& bin) { return bin.pose_to_frame.percentile_ms(0.95); });
  add("Age of the displayed pose, p95 of all ticks", "ms", scenario.bounds.pose_age_p95_ms,
      [](const auto&, const SeriesBin& bin) { return bin.pose_age.percentile_ms(0.95); });
  add("Frames of a session", "1/s", {}, [&](const auto& group, const SeriesBin& bin) {
    return per_session(group, static_cast<double>(bin.frames));
  });
  add("Bitrate of a session", "kbit/s", {}, [&](const auto& group, const SeriesBin& bin) {
    return per_session(group, 8e-3 * static_cast<double>(bin.bytes));
  });
  add("Size of a frame", "megapixels", {}, [](const auto&, const SeriesBin& bin) {
    return 1e-6 * static_cast<double>(bin.pixels) / static_cast<double>(bin.frames);
  });
  add("Sessions that got a frame", "", {},
      [](const auto&, const SeriesBin& bin) { return static_cast<double>(bin.sessions); });
  return plots;
}

void add_usage_plots(const std::vector<UsageSample>& usage, Json& plots) {
  if (usage.empty()) return;
  Json server = curve("server"), generator = curve("catgs-load"), others = curve("others"),
       memory = curve("server");
  for (const UsageSample& sample : usage) {
    add_point(server, sample.at_s, 100.0 * sample.server_cpu);
    add_point(generator, sample.at_s, 100.0 * sample.generator_cpu);
    const double rest = sample.machine_cpu - sample.server_cpu - sample.generator_cpu;
    add_point(others, sample.at_s, std::max(0.0, 100.0 * rest));
    add_point(memory, sample.at_s, sample.server_rss_mb);
  }
  plots.push_back({{"title", "CPU, share of all cores"},
                   {"unit", "%"},
                   {"curves", {std::move(server), std::move(generator), std::move(others)}}});
  plots.push_back(
      {{"title", "Resident memory"}, {"unit", "MB"}, {"curves", Json::array({std::move(memory)})}});
}

/// Share of the frames up to x, from the histogram's percentiles.
Json distribution(const char* title, const RunReport& report,
                  DurationHistogram Durations::*member) {
  Json curves = Json::array();
  for (const GroupReport& group : report.groups) {
    const DurationHistogram all = merged(group.sessions, member);
    Json& of_group = curves.emplace_back(curve(group.name));
    std::map<double, double> share_up_to;
    for (int i = 1; i <= 999 && all.count() > 0; ++i)
      share_up_to[std::max(0.01, all.percentile_ms(1e-3 * i))] = 0.1 * i;
    for (const auto& [x, share] : share_up_to) add_point(of_group, x, share);
  }
  return {{"title", title},
          {"unit", "% of frames up to x ms"},
          {"x", "log"},
          {"curves", std::move(curves)}};
}

Json stage_table(const RunReport& report) {
  Json rows = Json::array();
  for (const NamedHistogram& histogram : named_histograms()) {
    DurationHistogram all;
    for (const GroupReport& group : report.groups)
      all.add(merged(group.sessions, histogram.member));
    if (all.count() > 0)
      rows.push_back({histogram.meaning, all.percentile_ms(0.5), all.percentile_ms(0.95),
                      all.percentile_ms(0.99), all.max_ms()});
  }
  return {{"columns", {"ms, all frames", "p50", "p95", "p99", "max"}}, {"rows", std::move(rows)}};
}

Json metric_table(const Metrics& metrics) {
  Json rows = Json::array();
  for (const auto& [name, value] : metrics) rows.push_back(Json::array({name, value}));
  return {{"columns", {"metric", "value"}}, {"rows", std::move(rows)}};
}

/// Points of each group's judged refreshes. Groups of a matrix whose names differ in the last part
/// share a plot.
template <typename Add>
void add_display_plots(const RunReport& report, const Json& plot, Add add, Json& plots) {
  std::map<std::string, Json> families;
  for (const GroupReport& group : report.groups) {
    const std::size_t slash = group.name.rfind('/');
    const bool alone = slash == std::string::npos;
    Json of_group = curve(alone ? group.name : group.name.substr(slash + 1));
    for (const auto& session : group.sessions) add(*session, of_group);
    if (of_group["x"].empty()) continue;
    families[alone ? "" : group.name.substr(0, slash)].push_back(std::move(of_group));
  }
  for (auto& [family, curves] : families) {
    Json& one = plots.emplace_back(plot);
    if (!family.empty())
      one["title"] = fmt::format("{}: {}", family, plot["title"].get<std::string>());
    one["curves"] = std::move(curves);
  }
}

void add_displays(const RunReport& report, const HoldBounds& bounds, Json& parts) {
  const PaperTable displays = display_table(report, bounds);
  if (displays.rows.empty()) return;
  Json table = {{"columns", Json::array({"clients"})}, {"rows", Json::array()}};
  for (const std::string& column : displays.columns) table["columns"].push_back(column);
  for (const PaperTable::Row& row : displays.rows) {
    Json& cells = table["rows"].emplace_back(Json::array({row.name}));
    for (const Number& number : row.numbers) {
      const bool never = std::isinf(number.value);  // JSON has no infinity
      cells.push_back(never ? Json("∞") : Json(number.value));
    }
  }
  Json plots = Json::array();
  const auto over_time = [&](const Json& plot, auto value) {
    add_display_plots(
        report, plot,
        [&](const SessionReport& session, Json& curve) {
          for (const JudgedRefresh& refresh : session.judged) {
            if (refresh.sampled) add_point(curve, refresh.at_s, value(refresh));
          }
        },
        plots);
  };
  over_time({{"title", "SSIM over time"}, {"unit", "SSIM"}, {"floor", 0.5}},
            [](const JudgedRefresh& refresh) { return refresh.ssim; });
  over_time({{"title", "PSNR over time"}, {"unit", "dB"}, {"floor", 15.0}},
            [](const JudgedRefresh& refresh) { return refresh.psnr_db; });
  over_time({{"title", "Pose age over time"}, {"unit", "ms"}},
            [](const JudgedRefresh& refresh) { return refresh.age_ms; });
  add_display_plots(
      report, {{"title", "SSIM of refreshes"}, {"unit", "% up to x"}},
      [](const SessionReport& session, Json& curve) {
        std::map<double, std::size_t> count;
        std::size_t all = 0;
        for (const JudgedRefresh& refresh : session.judged) {
          if (refresh.sampled) ++count[refresh.ssim], ++all;
        }
        std::size_t sum = 0;
        for (const auto& [ssim, refreshes] : count) {
          sum += refreshes;
          add_point(curve, ssim, 100.0 * static_cast<double>(sum) / static_cast<double>(all));
        }
      },
      plots);
  parts.push_back({{"heading", "What visitors saw, over seconds. " + displays.notes.front()},
                   {"table", std::move(table)},
                   {"plots", std::move(plots)}});
}

}  // namespace

Json chart_document(const Scenario& scenario, const Outcome& outcome) {
  const RunReport& report = outcome.report;
  std::string facts = fmt::format("catgs-load {} ({}), {:g} s", build_version, build_commit,
                                  scenario.load.duration_s);
  for (const GroupReport& group : report.groups) {
    if (const SessionReport* first = admitted(group.sessions)) {
      facts += fmt::format(" · {} · {}", first->renderer, first->encoder);
      break;
    }
  }
  Json plots = time_plots(scenario, report);
  add_usage_plots(outcome.usage, plots);
  Json parts = Json::array();
  if (!outcome.requirements.empty())
    parts.push_back({{"heading", "Requirements"}, {"table", requirement_table(outcome)}});
  add_displays(report, scenario.bounds, parts);
  parts.push_back({{"heading", "Clients"}, {"table", group_table(report, scenario.bounds)}});
  parts.push_back({{"heading", "Over time, in seconds"}, {"plots", std::move(plots)}});
  parts.push_back({{"heading", "Distributions"},
                   {"plots",
                    {distribution("Pose sent to frame received", report, &Durations::pose_to_frame),
                     distribution("Between two frames", report, &Durations::frame_interval)}}});
  parts.push_back({{"heading", "Stages"}, {"table", stage_table(report)}});
  parts.push_back({{"heading", "All metrics"}, {"table", metric_table(outcome.metrics)}});
  return {{"title", scenario.title.empty() ? "Load test" : scenario.title},
          {"facts", std::move(facts)},
          {"parts", std::move(parts)}};
}

std::string read_charts_page() {
  const std::filesystem::path path = built_client() / "charts.html";
  std::ifstream file(path, std::ios::binary);
  std::string page(std::istreambuf_iterator<char>(file), {});
  if (!file || page.empty())
    throw InputError("--html", path.string(), "the page of charts is missing",
                     "build the web client (cmake -DCATGS_WEB=ON, target catgs_web)");
  return page;
}

std::string with_document(std::string page, const Json& document) {
  constexpr std::string_view mark = R"(id="document">)";
  const std::size_t at = page.find(mark);
  if (at == std::string::npos)
    throw InputError("--html", "", "the page of charts has no place for a document",
                     "build the web client of the same version");
  // A name in it must not end the element.
  std::string text;
  for (const char c : document.dump(-1, ' ', false, Json::error_handler_t::replace))
    text.append(c == '/' && text.ends_with('<') ? "\\/" : std::string(1, c));
  return page.insert(at + mark.size(), text);
}

}  // namespace catgs::load
