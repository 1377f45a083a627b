#include "tests/load/html_report.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "render_core/base/build_info.h"
#include "server/net/http.h"
#include "tests/load/report.h"
#include "tests/load/svg_plot.h"

namespace catgs::load {
namespace {

constexpr const char* style = R"(
:root { color-scheme: light dark; --ink: #1d2430; --soft: #667085; --paper: #fbfbf9; --line: #e2e4e8;
  --c0: #0b6bcb; --c1: #d9540b; --c2: #1a8a4c; --c3: #8a3fc4; --c4: #b8860b; --c5: #0d8a94; --bad: #c8201e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8ec; --soft: #98a2b3; --paper: #14171c;
  --line: #2b313a; --c0: #5aa9f5; --c1: #f58a4b; --c2: #4cc283; --c3: #bd8af0; --c4: #e0b84c;
  --c5: #4cc5cf; --bad: #ff6b66; } }
body { margin: 2rem auto; max-width: 74rem; padding: 0 1rem; background: var(--paper); color: var(--ink);
  font: 15px/1.45 system-ui, sans-serif; }
h1 { font-size: 1.5rem; margin-bottom: .2rem; } h2 { font-size: 1.1rem; margin: 2rem 0 .6rem; }
p.facts { color: var(--soft); margin: 0; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(26rem, 1fr)); gap: 1rem; }
svg { width: 100%; font: 11px system-ui, sans-serif; fill: var(--soft); }
svg .title { font-size: 13px; font-weight: 600; fill: var(--ink); }
.grid { stroke: var(--line); } .bound { stroke: var(--bad); stroke-dasharray: 5 4; }
.curve { fill: none; stroke-width: 1.8; }
.c0 { stroke: var(--c0); } .c1 { stroke: var(--c1); } .c2 { stroke: var(--c2); }
.c3 { stroke: var(--c3); } .c4 { stroke: var(--c4); } .c5 { stroke: var(--c5); }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .8rem .2rem 0; text-align: right; border-bottom: 1px solid var(--line); }
th { font-weight: 600; color: var(--soft); } th:first-child, td:first-child { text-align: left; }
.good { color: var(--c2); } .bad { color: var(--bad); }
details { margin-top: 1rem; }
)";

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.4g}", value) : "–";
}

std::string requirement_table(const Outcome& outcome) {
  if (outcome.requirements.empty()) return {};
  std::string html = "<h2>Requirements</h2>\n<table>\n";
  for (const Requirement& requirement : outcome.requirements) {
    const bool holds = requirement.holds(outcome.metrics);
    html += fmt::format("<tr><td>{}</td><td>{}</td><td class=\"{}\">{}</td></tr>\n",
                        escape_html(requirement.text()), number(requirement.value(outcome.metrics)),
                        holds ? "good" : "bad", holds ? "holds" : "does not hold");
  }
  return html + "</table>\n";
}

/// One curve a group: `value` of each bin.
template <typename Value>
std::vector<Curve> over_time(const RunReport& report, double duration_s, Value value) {
  std::vector<Curve> curves;
  for (const GroupReport& group : report.groups) {
    Curve& curve = curves.emplace_back();
    curve.name = group.name;
    const auto& bins = group.series->bins();
    for (std::size_t i = 0; i < bins.size(); ++i) {
      // The last frames come a moment after the end.
      if (static_cast<double>(i) * group.series->bin_s() >= duration_s) break;
      const double middle_s = (static_cast<double>(i) + 0.5) * group.series->bin_s();
      curve.points.emplace_back(middle_s, value(group, bins[i]));
    }
  }
  return curves;
}

/// Share of values up to x, from the histogram's percentiles.
std::vector<Curve> distribution(const RunReport& report, DurationHistogram Durations::*member) {
  std::vector<Curve> curves;
  for (const GroupReport& group : report.groups) {
    const DurationHistogram all = merged(group.sessions, member);
    Curve& curve = curves.emplace_back();
    curve.name = group.name;
    if (all.count() == 0) continue;
    for (int i = 1; i <= 999; ++i) {
      const double x = std::max(0.01, all.percentile_ms(1e-3 * i));
      curve.points.emplace_back(x, 0.1 * i);
    }
  }
  return curves;
}

std::string time_plots(const Scenario& scenario, const RunReport& report) {
  const auto plot = [&](const char* title, const char* unit, std::vector<double> bounds,
                        auto value) {
    return line_plot({.title = title, .x_unit = "s", .y_unit = unit, .bounds = std::move(bounds)},
                     over_time(report, scenario.load.duration_s, value));
  };
  const auto per_session = [](const GroupReport& group, double sum) {
    return sum / (group.series->bin_s() * static_cast<double>(group.sessions.size()));
  };
  return plot("Pose sent to frame received, p95", "ms", {scenario.bounds.pose_to_frame_p95_ms},
              [](const auto&, const SeriesBin& bin) {
                return bin.pose_to_frame.percentile_ms(0.95);
              }) +
         plot("Age of the pose on show, p95 of all ticks", "ms", {scenario.bounds.pose_age_p95_ms},
              [](const auto&, const SeriesBin& bin) { return bin.pose_age.percentile_ms(0.95); }) +
         plot("Frames of a session", "1/s", {},
              [&](const auto& group, const SeriesBin& bin) {
                return per_session(group, static_cast<double>(bin.frames));
              }) +
         plot("Bitrate of a session", "kbit/s", {},
              [&](const auto& group, const SeriesBin& bin) {
                return per_session(group, 8e-3 * static_cast<double>(bin.bytes));
              }) +
         plot("Size of a frame", "megapixels", {},
              [](const auto&, const SeriesBin& bin) {  // without frames 0 / 0: no point
                return 1e-6 * static_cast<double>(bin.pixels) / static_cast<double>(bin.frames);
              }) +
         plot("Sessions that got a frame", "", {},
              [](const auto&, const SeriesBin& bin) { return static_cast<double>(bin.sessions); });
}

std::string usage_plots(const std::vector<UsageSample>& usage) {
  if (usage.empty()) return {};
  Curve server{"server", {}}, generator{"catgs-load", {}}, others{"others", {}},
      memory{"server", {}};
  for (const UsageSample& sample : usage) {
    server.points.emplace_back(sample.at_s, 100.0 * sample.server_cpu);
    generator.points.emplace_back(sample.at_s, 100.0 * sample.generator_cpu);
    others.points.emplace_back(
        sample.at_s,
        std::max(0.0, 100.0 * (sample.machine_cpu - sample.server_cpu - sample.generator_cpu)));
    memory.points.emplace_back(sample.at_s, sample.server_rss_mb);
  }
  return line_plot(
             {.title = "CPU, share of all cores", .x_unit = "s", .y_unit = "%", .max_y = 100.0},
             {server, generator, others}) +
         line_plot({.title = "Resident memory", .x_unit = "s", .y_unit = "MB"}, {memory});
}

std::string group_table(const RunReport& report, const HoldBounds& bounds) {
  std::string html =
      "<h2>Clients</h2>\n<table>\n<tr><th>group</th><th>sessions</th><th>fps min</th><th>mean</th>"
      "<th>max</th><th>kbit/s</th><th>pose to frame p50</th><th>p95</th><th>p99 ms</th>"
      "<th>pose age p95 ms</th><th>PSNR dB</th><th>held</th><th>errors</th></tr>\n";
  for (const GroupReport& group : report.groups) {
    const Metrics metrics = collect_metrics(group.sessions, group.nominal_fps, bounds);
    html += fmt::format("<tr><td>{}</td>", escape_html(group.name));
    for (const char* name :
         {"sessions_connected", "fps_min", "fps_mean", "fps_max", "bitrate_kbps_mean",
          "pose_to_frame_p50_ms", "pose_to_frame_p95_ms", "pose_to_frame_p99_ms", "pose_age_p95_ms",
          "psnr_mean_db", "sessions_held", "errors"}) {
      html += fmt::format("<td>{}</td>", number(value_of(metrics, name)));
    }
    html += "</tr>\n";
  }
  return html + "</table>\n";
}

std::string stage_table(const RunReport& report) {
  std::string html =
      "<h2>Where the time goes</h2>\n<table>\n<tr><th>ms, all frames</th><th>p50</th><th>p95</th>"
      "<th>p99</th><th>max</th></tr>\n";
  for (const NamedHistogram& histogram : named_histograms()) {
    DurationHistogram all;
    for (const GroupReport& group : report.groups)
      all.add(merged(group.sessions, histogram.member));
    if (all.count() == 0) continue;
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                        escape_html(histogram.meaning), number(all.percentile_ms(0.5)),
                        number(all.percentile_ms(0.95)), number(all.percentile_ms(0.99)),
                        number(all.max_ms()));
  }
  return html + "</table>\n";
}

std::string metric_list(const Metrics& metrics) {
  std::string html = "<details><summary>All metrics</summary>\n<table>\n";
  for (const auto& [name, value] : metrics) {
    html += fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", escape_html(name), number(value));
  }
  return html + "</table>\n</details>\n";
}

}  // namespace

std::string to_html(const Scenario& scenario, const Outcome& outcome) {
  const std::string title = scenario.title.empty() ? "Load test" : scenario.title;
  std::string facts = fmt::format("catgs-load {} ({}), {:g} s", build_version, build_commit,
                                  scenario.load.duration_s);
  for (const GroupReport& group : outcome.report.groups) {
    if (const SessionReport* first = admitted(group.sessions)) {
      facts += fmt::format(" · {} · {}", first->renderer, first->encoder);
      break;
    }
  }
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width\"><title>{0}</title>"
      "<style>{1}</style></head><body>\n<h1>{0}</h1>\n<p class=\"facts\">{2}</p>\n",
      escape_html(title), style, escape_html(facts));
  html += requirement_table(outcome);
  html += group_table(outcome.report, scenario.bounds);
  html += "<h2>Over time</h2>\n<div class=\"plots\">\n";
  html += time_plots(scenario, outcome.report) + usage_plots(outcome.usage) + "</div>\n";
  html += "<h2>Distributions</h2>\n<div class=\"plots\">\n";
  const auto plot = [&](const char* what, DurationHistogram Durations::*member) {
    return line_plot({.title = what,
                      .x_unit = "ms",
                      .y_unit = "% of frames up to x",
                      .max_y = 100.0,
                      .log_x = true},
                     distribution(outcome.report, member));
  };
  html += plot("Pose sent to frame received", &Durations::pose_to_frame);
  html += plot("Between two frames", &Durations::frame_interval);
  html += "</div>\n" + stage_table(outcome.report) + metric_list(outcome.metrics);
  return html + "</body></html>\n";
}

}  // namespace catgs::load
