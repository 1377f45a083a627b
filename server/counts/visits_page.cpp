#include "server/counts/visits_page.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

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

/// RFC 4180. A text that a spreadsheet would take for a formula gets an apostrophe.
std::string csv_text(std::string_view text) {
  std::string out = "\"";
  if (!text.empty() && std::string_view("=+-@\t\r").find(text.front()) != std::string_view::npos)
    out += '\'';
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + '"';
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
std::pair<std::string, std::string> stop_titles(const VisitsPage::Titles& titles,
                                                const StopId& id) {
  std::pair<std::string, std::string> of{fmt::format("tour {}", id.tour + 1),
                                         fmt::format("stop {}", id.stop + 1)};
  if (!titles || id.tour >= titles->size()) return of;
  const TourTitles& tour = (*titles)[id.tour];
  if (!tour.tour.empty()) of.first = tour.tour;
  if (id.stop < tour.stops.size() && !tour.stops[id.stop].empty()) of.second = tour.stops[id.stop];
  return of;
}

/// A document that is made from one day after the other, so that it takes the memory of one.
class DayByDay {
 public:
  struct Parts {
    std::string head;
    std::function<std::vector<std::string>()> dates;
    std::function<std::string(const std::string& date, const DayCounts& day)> of_day;
    std::function<std::string()> end = [] { return std::string(); };
  };
  DayByDay(const VisitBook& book, Parts parts)
      : book_(book), parts_(std::move(parts)), text_(parts_.head) {}

  /// See HttpResponse::next_piece.
  std::optional<std::string> next() {
    constexpr std::size_t most_bytes = 64 * 1024;
    if (sent_ == text_.size() && !read_more()) return std::nullopt;
    std::string piece = text_.substr(sent_, most_bytes);
    sent_ += piece.size();
    return piece;
  }

 private:
  bool read_more() {
    if (!dates_) dates_ = parts_.dates();
    if (days_ > dates_->size()) return false;
    text_ = days_ < dates_->size() ? parts_.of_day((*dates_)[days_], book_.day((*dates_)[days_]))
                                   : parts_.end();
    ++days_;
    sent_ = 0;
    return true;
  }

  const VisitBook& book_;
  const Parts parts_;
  std::optional<std::vector<std::string>> dates_;
  std::size_t days_ = 0;  // that were read, and one for the end
  std::string text_;
  std::size_t sent_ = 0;  // bytes of it
};

std::string counts_rows(const std::string& date, const DayCounts& day) {
  std::string out;
  for (const auto& [id, counts] : day) {
    out += fmt::format("{},{},{},{:.0f},{}", date, csv_text(id), counts.visits, counts.seconds,
                       counts.bytes);
    for (const std::uint64_t visits : counts.devices) out += fmt::format(",{}", visits);
    out += "\r\n";
  }
  return out;
}

std::string stops_rows(const std::string& date, const DayCounts& day,
                       const VisitsPage::TitlesOf& titles_of) {
  std::string out;
  for (const auto& [id, counts] : day) {
    const auto titles = counts.stops.empty() ? nullptr : titles_of(id);
    for (const auto& [stop, visits] : counts.stops) {
      const auto [tour, title] = stop_titles(titles, stop);
      out += fmt::format("{},{},{},{},{},{},{}\r\n", date, csv_text(id), stop.tour + 1,
                         stop.stop + 1, csv_text(tour), csv_text(title), visits);
    }
  }
  return out;
}

/// What the page shows of some days, of all scenes or of one.
struct Summary {
  std::string only;  // a scene's id; empty: all
  DayCounts scenes{};
  SceneCounts sum{};  // without stops
  std::vector<std::pair<std::string, double>> visits{}, hours{};

  void take(const std::string& date, DayCounts day) {
    SceneCounts of_day;
    for (auto& [id, counts] : day) {
      if (id != only) counts.stops.clear();
      if (!only.empty() && id != only) continue;
      of_day.visits += counts.visits;
      of_day.seconds += counts.seconds;
    }
    add(day, scenes);
    sum.visits += of_day.visits;
    sum.seconds += of_day.seconds;
    visits.emplace_back(date, static_cast<double>(of_day.visits));
    hours.emplace_back(date, of_day.seconds / 3600.0);
  }
};

std::string html_of(const Summary& all, const VisitsPage::TitlesOf& titles_of) {
  const std::size_t days = all.visits.size();
  const std::string what = all.only.empty() ? "all scenes" : escape_html(name_in(all.only));
  std::string out = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\" />"
      "<meta name=\"viewport\" content=\"width=device-width\" /><title>Visits</title>"
      "<link rel=\"stylesheet\" href=\"/visits.css\" /></head><body>\n"
      "<h1>Visits: {}, {} days</h1>\n<p>{} visits, {:.1f} hours. ",
      what, days, all.sum.visits, all.sum.seconds / 3600.0);
  for (const int other : {7, 30, 90, 400})
    out += fmt::format("<a href=\"/visits?days={}\">{} days</a> · ", other, other);
  out += "<a href=\"/visits.csv\">CSV</a> · <a href=\"/visits/stops.csv\">CSV of stops</a></p>\n";
  out += "<h2>Visits by day</h2>\n" + plot(all.visits, "visits");
  out += "<h2>Hours by day</h2>\n" + plot(all.hours, "hours");
  out +=
      "<h2>Scenes</h2>\n<div class=\"wide\"><table><tr><th>Scene</th><th>Visits</th>"
      "<th>Hours</th><th>Minutes a visit</th><th>MB an hour</th><th>Desktop</th><th>Phone</th>"
      "<th>Tablet</th><th>Headset</th><th>Unknown</th></tr>\n";
  for (const auto& [id, counts] : all.scenes)
    out += scene_row(fmt::format("<a href=\"/visits?days={}&amp;scene={}\">{}</a>", days,
                                 escape_html(percent_encoded(id)), escape_html(name_in(id))),
                     counts);
  out += "</table></div>\n";
  const auto shown = all.scenes.find(all.only);
  if (shown == all.scenes.end()) return out + "</body></html>\n";
  out +=
      "<h2>Stops</h2>\n<table><tr><th>Tour</th><th>Stop</th><th>Visits that reached it</th>"
      "</tr>\n";
  const VisitsPage::Titles titles = titles_of(all.only);
  for (const auto& [stop, reached] : shown->second.stops) {
    const auto [tour, title] = stop_titles(titles, stop);
    out += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n", escape_html(tour),
                       escape_html(title), reached);
  }
  return out + "</table>\n</body></html>\n";
}

DayByDay::Parts page_parts(const HttpRequest& request, std::int64_t unix_s,
                           const VisitsPage::TitlesOf& titles_of) {
  DayByDay::Parts parts;
  parts.dates = [days = days_of(request), unix_s] {
    std::vector<std::string> dates;
    for (int i = days - 1; i >= 0; --i) dates.push_back(date_of(unix_s - i * seconds_a_day));
    return dates;
  };
  const auto summary = std::make_shared<Summary>(Summary{argument(request, "scene")});
  if (!summary->only.empty()) summary->scenes[summary->only];  // however many others there are
  parts.of_day = [summary](const std::string& date, const DayCounts& day) {
    summary->take(date, day);
    return std::string();
  };
  parts.end = [summary, titles_of] { return html_of(*summary, titles_of); };
  return parts;
}

}  // namespace

std::optional<HttpResponse> VisitsPage::respond(const HttpRequest& request) const {
  if (request.path == "/visits.css") return text_response(200, std::string(style), "text/css");
  DayByDay::Parts parts;
  parts.dates = [&book = book_] { return book.dates(); };
  HttpResponse response;
  response.content_type = "text/csv; charset=utf-8";
  if (request.path == "/visits") {
    parts = page_parts(request, unix_s_(), titles_of_);
    response.content_type = "text/html; charset=utf-8";
  } else if (request.path == "/visits.csv") {
    parts.head =
        fmt::format("date,scene,visits,seconds,bytes,{}\r\n", fmt::join(device_names, ","));
    parts.of_day = counts_rows;
  } else if (request.path == "/visits/stops.csv") {
    parts.head = "date,scene,tour,stop,tour title,stop title,visits\r\n";
    parts.of_day = [titles_of = titles_of_](const std::string& date, const DayCounts& day) {
      return stops_rows(date, day, titles_of);
    };
  } else {
    return std::nullopt;
  }
  response.next_piece = [document = std::make_shared<DayByDay>(book_, std::move(parts))] {
    return document->next();
  };
  return response;
}

}  // namespace catgs
