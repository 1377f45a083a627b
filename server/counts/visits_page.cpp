#include "server/counts/visits_page.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "server/base/scene_id.h"

namespace catgs {
namespace {

constexpr int usual_days = 30;
constexpr std::int64_t seconds_a_day = 86'400;

constexpr std::string_view style =
    R"(:root { color-scheme: light dark; --bar: #2a78d6; --line: #8888; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: right; padding: .3rem .6rem; border-bottom: 1px solid var(--line); }
th:first-child, td:first-child { text-align: left; }
svg { width: 100%; height: auto; } svg rect { fill: var(--bar); }
svg text { font-size: 11px; fill: currentColor; } svg line { stroke: var(--line); }
.wide { overflow-x: auto; }
@media (prefers-color-scheme: dark) { :root { --bar: #6aa9f4; } }
)";

std::string argument(const HttpRequest& request, std::string_view name) {
  for (const std::string& given : request.arguments)
    if (given.size() > name.size() && given.starts_with(name) && given[name.size()] == '=')
      return given.substr(name.size() + 1);
  return {};
}

int days_of(const HttpRequest& request) {
  const std::string text = argument(request, "days");
  int days = usual_days;
  std::from_chars(text.data(), text.data() + text.size(), days);
  return std::clamp(days, 1, static_cast<int>(VisitCounts::most_days));
}

void add(const SceneCounts& from, SceneCounts& to) {
  to.visits += from.visits;
  to.seconds += from.seconds;
  to.bytes += from.bytes;
  for (std::size_t i = 0; i < device_kinds; ++i) to.devices[i] += from.devices[i];
  for (const auto& [stop, visits] : from.stops) to.stops[stop] += visits;
}

/// RFC 4180. A text that a spreadsheet would take for a formula gets an apostrophe.
std::string csv_text(std::string_view text) {
  std::string out = "\"";
  if (!text.empty() && std::string_view("=+-@\t\r").find(text.front()) != std::string_view::npos)
    out += '\'';
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + '"';
}

std::string counts_csv(const CountsByDay& days) {
  std::string out = "date,scene,visits,seconds,bytes";
  for (const std::string_view device : device_names) out += fmt::format(",{}", device);
  out += "\r\n";
  for (const auto& [date, day] : days)
    for (const auto& [id, counts] : day) {
      out += fmt::format("{},{},{},{:.0f},{}", date, csv_text(id), counts.visits, counts.seconds,
                         counts.bytes);
      for (const std::uint64_t visits : counts.devices) out += fmt::format(",{}", visits);
      out += "\r\n";
    }
  return out;
}

/// A bar for each day, up to `top`. `text`: of the highest bar.
std::string plot(const std::vector<std::pair<std::string, double>>& values,
                 const std::string& unit) {
  constexpr double width = 900, height = 180, left = 50, bottom = 20, above = 10;
  double top = 0.0;
  for (const auto& [date, value] : values) top = std::max(top, value);
  std::string out = fmt::format(
      "<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{} by day\">\n", width, height, unit);
  const double plot_height = height - bottom - above;
  const double step = (width - left) / static_cast<double>(values.size());
  out += fmt::format("<line x1=\"{0}\" x2=\"{1}\" y1=\"{2}\" y2=\"{2}\" />\n", left, width,
                     height - bottom);
  for (std::size_t i = 0; i < values.size() && top > 0.0; ++i) {
    const double bar = plot_height * values[i].second / top;
    out += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"><title>{}: "
        "{:.4g}</title></rect>\n",
        left + step * static_cast<double>(i), height - bottom - bar, std::max(1.0, 0.8 * step), bar,
        values[i].first, values[i].second);
  }
  out += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{:.2g}</text>\n", left - 6,
                     above + 8, top);
  out += fmt::format("<text x=\"{}\" y=\"{}\">{}</text>\n", left, height - 5, values.front().first);
  out += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>\n", width, height - 5,
                     values.back().first);
  return out + "</svg>\n";
}

double per_visit(double value, std::uint64_t visits) {
  return visits == 0 ? 0.0 : value / static_cast<double>(visits);
}

std::string scene_row(const std::string& name, const SceneCounts& counts) {
  const double hours = counts.seconds / 3600.0;
  std::string out =
      fmt::format("<tr><td>{}</td><td>{}</td><td>{:.1f}</td><td>{:.1f}</td><td>{:.0f}</td>", name,
                  counts.visits, hours, per_visit(counts.seconds / 60.0, counts.visits),
                  hours > 0.0 ? 1e-6 * static_cast<double>(counts.bytes) / hours : 0.0);
  for (std::size_t i = 1; i <= device_kinds; ++i)  // unknown devices last
    out += fmt::format("<td>{}</td>", counts.devices[i % device_kinds]);
  return out + "</tr>\n";
}

/// Titles are for people; without one, the number stands.
std::pair<std::string, std::string> stop_titles(const std::vector<TourTitles>& titles,
                                                const StopId& id) {
  std::pair<std::string, std::string> of{fmt::format("tour {}", id.tour + 1),
                                         fmt::format("stop {}", id.stop + 1)};
  if (id.tour >= titles.size()) return of;
  const TourTitles& tour = titles[id.tour];
  if (!tour.tour.empty()) of.first = tour.tour;
  if (id.stop < tour.stops.size() && !tour.stops[id.stop].empty()) of.second = tour.stops[id.stop];
  return of;
}

}  // namespace

std::vector<TourTitles> titles_of_tours(const std::string& answer) {
  const auto document = nlohmann::json::parse(answer, nullptr, false);
  const auto title = [](const nlohmann::json& of) {
    const bool has_one = of.is_object() && of.contains("title") && of["title"].is_string();
    return has_one ? of["title"].get<std::string>() : std::string();
  };
  std::vector<TourTitles> titles;
  try {
    for (const auto& tour : document.at("document").at("tours")) {
      TourTitles of{title(tour), {}};
      const auto& stops = tour.at("stops");
      if (!stops.is_array()) continue;
      for (const auto& stop : stops) of.stops.push_back(title(stop));
      if (!of.stops.empty()) titles.push_back(std::move(of));
    }
  } catch (const nlohmann::json::exception&) {  // no tours, or some that pages cannot read either
  }
  return titles;
}

std::optional<HttpResponse> VisitsPage::respond(const HttpRequest& request) const {
  if (request.path == "/visits")
    return text_response(200, html(request), "text/html; charset=utf-8");
  if (request.path == "/visits.css") return text_response(200, std::string(style), "text/css");
  if (request.path == "/visits.csv")
    return text_response(200, counts_csv(counts_.since()), "text/csv; charset=utf-8");
  if (request.path == "/visits/stops.csv")
    return text_response(200, stops_csv(), "text/csv; charset=utf-8");
  return std::nullopt;
}

std::string VisitsPage::html(const HttpRequest& request) const {
  const std::string only = argument(request, "scene");
  const int days = days_of(request);
  const CountsByDay all = counts_.since(date_of(unix_s_() - (days - 1) * seconds_a_day));
  DayCounts scenes;
  SceneCounts sum;
  std::vector<std::pair<std::string, double>> visits, hours;
  for (int i = days - 1; i >= 0; --i) {
    const std::string date = date_of(unix_s_() - i * seconds_a_day);
    SceneCounts of_day;
    if (const auto day = all.find(date); day != all.end())
      for (const auto& [id, counts] : day->second) {
        add(counts, scenes[id]);
        if (only.empty() || id == only) add(counts, of_day);
      }
    visits.emplace_back(date, static_cast<double>(of_day.visits));
    hours.emplace_back(date, of_day.seconds / 3600.0);
    add(of_day, sum);
  }
  const std::string what = only.empty() ? "all scenes" : escape_html(name_in(only));
  std::string out = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\" />"
      "<meta name=\"viewport\" content=\"width=device-width\" /><title>Visits</title>"
      "<link rel=\"stylesheet\" href=\"/visits.css\" /></head><body>\n"
      "<h1>Visits: {}, {} days</h1>\n<p>{} visits, {:.1f} hours. ",
      what, days, sum.visits, sum.seconds / 3600.0);
  for (const int other : {7, 30, 90, 400})
    out += fmt::format("<a href=\"/visits?days={}\">{} days</a> · ", other, other);
  out += "<a href=\"/visits.csv\">CSV</a> · <a href=\"/visits/stops.csv\">CSV of stops</a></p>\n";
  out += "<h2>Visits by day</h2>\n" + plot(visits, "visits");
  out += "<h2>Hours by day</h2>\n" + plot(hours, "hours");
  out +=
      "<h2>Scenes</h2>\n<div class=\"wide\"><table><tr><th>Scene</th><th>Visits</th>"
      "<th>Hours</th><th>Minutes a visit</th><th>MB an hour</th><th>Desktop</th><th>Phone</th>"
      "<th>Tablet</th><th>Headset</th><th>Unknown</th></tr>\n";
  for (const auto& [id, counts] : scenes)
    out += scene_row(fmt::format("<a href=\"/visits?days={}&amp;scene={}\">{}</a>", days,
                                 escape_html(percent_encoded(id)), escape_html(name_in(id))),
                     counts);
  out += "</table></div>\n";
  if (only.empty()) return out + "</body></html>\n";
  out +=
      "<h2>Stops</h2>\n<table><tr><th>Tour</th><th>Stop</th><th>Visits that reached it</th>"
      "</tr>\n";
  const std::vector<TourTitles> titles = titles_(only);
  for (const auto& [stop, reached] : sum.stops) {
    const auto [tour, title] = stop_titles(titles, stop);
    out += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", escape_html(tour),
                       escape_html(title), reached);
  }
  return out + "</table>\n</body></html>\n";
}

std::string VisitsPage::stops_csv() const {
  std::string out = "date,scene,tour,stop,tour title,stop title,visits\r\n";
  std::map<std::string, std::vector<TourTitles>> titles;
  for (const auto& [date, day] : counts_.since())
    for (const auto& [id, counts] : day) {
      if (!counts.stops.empty() && !titles.contains(id)) titles[id] = titles_(id);
      for (const auto& [stop, visits] : counts.stops) {
        const auto [tour, title] = stop_titles(titles[id], stop);
        out += fmt::format("{},{},{},{},{},{},{}\r\n", date, csv_text(id), stop.tour + 1,
                           stop.stop + 1, csv_text(tour), csv_text(title), visits);
      }
    }
  return out;
}

}  // namespace catgs
