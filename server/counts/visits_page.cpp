#include "server/counts/visits_page.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "server/base/scene_id.h"

namespace catgs {
namespace {

using Json = nlohmann::ordered_json;

constexpr int usual_days = 30;
constexpr std::int64_t seconds_a_day = 86'400;

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

/// A bar for each day.
Json plot(const std::string& title, const std::vector<std::pair<std::string, double>>& values) {
  Json curve = {{"name", title}, {"x", Json::array()}, {"y", Json::array()}};
  for (const auto& [date, value] : values) {
    curve["x"].push_back(date);
    curve["y"].push_back(value);
  }
  return {{"title", title},
          {"unit", ""},
          {"x", "dates"},
          {"bars", true},
          {"curves", Json::array({std::move(curve)})}};
}

Json link(std::string_view text, const std::string& href) {
  return {{"text", text}, {"href", href}};
}

double per_visit(double value, std::uint64_t visits) {
  return visits == 0 ? 0.0 : value / static_cast<double>(visits);
}

/// "1:05": people read no "1.083".
std::string hours_and_minutes(double seconds) {
  const auto minutes = std::llround(seconds / 60.0);
  return fmt::format("{}:{:02}", minutes / 60, minutes % 60);
}

Json scene_row(Json name, const SceneCounts& counts) {
  const auto tenths = [](double value) { return std::round(10.0 * value) / 10.0; };
  const double hours = counts.seconds / 3600.0;
  Json row = {std::move(name), counts.visits, hours_and_minutes(counts.seconds),
              tenths(per_visit(counts.seconds / 60.0, counts.visits)),
              tenths(hours > 0.0 ? 1e-6 * static_cast<double>(counts.bytes) / hours : 0.0)};
  for (std::size_t i = 1; i <= device_kinds; ++i)  // unknown devices last
    row.push_back(counts.devices[i % device_kinds]);
  return row;
}

/// Titles are for people; without one, the number stands.
std::pair<std::string, std::string> stop_titles(const VisitsPage::Titles& titles,
                                                const StopId& id) {
  std::pair<std::string, std::string> of{fmt::format("tour {}", id.tour + 1),
                                         fmt::format("stop {}", id.stop + 1)};
  if (!titles.tours || id.tour >= titles.tours->size()) return of;
  const TourTitles& tour = (*titles.tours)[id.tour];
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
  DayByDay(const UsageStatistics& statistics, Parts parts)
      : statistics_(statistics), parts_(std::move(parts)), text_(parts_.head) {}

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
    text_ = days_ < dates_->size()
                ? parts_.of_day((*dates_)[days_], statistics_.day((*dates_)[days_]))
                : parts_.end();
    ++days_;
    sent_ = 0;
    return true;
  }

  const UsageStatistics& statistics_;
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
    const auto titles = counts.stops.empty() ? VisitsPage::Titles() : titles_of(id);
    for (const auto& [stop, visits] : counts.stops) {
      const auto [tour, title] = stop_titles(titles, stop);
      out += fmt::format("{},{},{},{},{},{},{}\r\n", date, csv_text(id), stop.tour + 1,
                         stop.stop + 1, csv_text(tour), csv_text(title), visits);
    }
  }
  return out;
}

/// The counts of some days, of all scenes or of one.
struct Summary {
  std::string only;  // a scene's id; empty: all
  VisitsPage::Shows shows{};
  DayCounts scenes{};
  SceneCounts sum{};  // without stops
  std::vector<std::pair<std::string, double>> visits{}, hours{};

  void take(const std::string& date, DayCounts day) {
    SceneCounts of_day;
    if (shows) std::erase_if(day, [&](const auto& scene) { return !shows(scene.first); });
    for (auto& [id, counts] : day) {
      if (id != only) counts.stops.clear();
      const auto links = std::exchange(counts.links, {});
      if (!only.empty() && id != only) continue;
      for (const auto& [link, count] : links)
        if (sum.links.size() < VisitCounts::most_stops || sum.links.contains(link))
          sum.links[link] += count;
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

Json table(std::string_view heading, Json columns, Json rows) {
  return {{"heading", heading},
          {"table", {{"columns", std::move(columns)}, {"rows", std::move(rows)}}}};
}

/// Most visits first.
Json link_rows(const SceneCounts& sum) {
  std::vector<std::pair<std::string, std::uint64_t>> links(sum.links.begin(), sum.links.end());
  std::ranges::stable_sort(links, std::ranges::greater(), [](const auto& of) { return of.second; });
  std::uint64_t others = sum.visits;
  Json rows = Json::array();
  for (const auto& [id, visits] : links) {
    rows.push_back({id, visits});
    others -= std::min(others, visits);
  }
  rows.push_back({"none, or not counted by link", others});
  return rows;
}

/// For charts.html of the web client. Addresses are relative to that of the page.
std::string json_of(const Summary& all, const VisitsPage::TitlesOf& titles_of) {
  const std::size_t days = all.visits.size();
  const auto called = [&](const std::string& id) {
    const std::string title = titles_of(id).scene;
    return title.empty() ? std::string(name_in(id)) : title;
  };
  const std::string chosen = all.only.empty() ? "" : "&scene=" + percent_encoded(all.only);
  const std::string every = all.shows ? "your scenes" : "all scenes";
  const std::string whose = all.only.empty() ? every : called(all.only);
  Json links = Json::array(), rows = Json::array();
  for (const int other : {7, 30, 90, 400})
    links.push_back(
        link(fmt::format("{} days", other), fmt::format("visits?days={}{}", other, chosen)));
  if (!all.only.empty()) links.push_back(link("All scenes", fmt::format("visits?days={}", days)));
  if (!all.shows) {
    links.push_back(link("CSV", "visits.csv"));
    links.push_back(link("CSV of stops", "visits/stops.csv"));
  }
  for (const auto& [id, counts] : all.scenes)
    rows.push_back(scene_row(
        link(called(id), fmt::format("visits?days={}&scene={}", days, percent_encoded(id))),
        counts));
  Json parts = Json::array();
  parts.push_back({{"heading", "By day"},
                   {"plots", Json::array({plot("Visits", all.visits), plot("Hours", all.hours)})}});
  parts.push_back(table("Scenes",
                        {"Scene", "Visits", "Hours", "Minutes a visit", "MB an hour", "Desktop",
                         "Phone", "Tablet", "Headset", "Unknown"},
                        std::move(rows)));
  parts.push_back(table("Links", {"Link", "Visits"}, link_rows(all.sum)));
  if (const auto shown = all.scenes.find(all.only); shown != all.scenes.end()) {
    const VisitsPage::Titles titles = titles_of(all.only);
    Json stops = Json::array();
    for (const auto& [stop, reached] : shown->second.stops) {
      const auto [tour, title] = stop_titles(titles, stop);
      stops.push_back({tour, title, reached});
    }
    parts.push_back(table("Stops", {"Tour", "Stop", "Visits that reached it"}, std::move(stops)));
  }
  const Json document = {
      {"title", fmt::format("Visits: {}, {} days", whose, days)},
      {"facts", fmt::format("{} visits, {:.1f} hours", all.sum.visits, all.sum.seconds / 3600.0)},
      {"links", std::move(links)},
      {"parts", std::move(parts)}};
  return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

DayByDay::Parts summary_parts(const HttpRequest& request, std::int64_t unix_s,
                              const VisitsPage::TitlesOf& titles_of, VisitsPage::Shows shows) {
  DayByDay::Parts parts;
  parts.dates = [days = days_of(request), unix_s] {
    std::vector<std::string> dates;
    for (int i = days - 1; i >= 0; --i) dates.push_back(date_of(unix_s - i * seconds_a_day));
    return dates;
  };
  const auto summary =
      std::make_shared<Summary>(Summary{argument(request, "scene"), std::move(shows)});
  if (summary->shows && !summary->only.empty() && !summary->shows(summary->only))
    summary->only.clear();  // an author does not learn even its title
  if (!summary->only.empty()) summary->scenes[summary->only];  // however many others there are
  parts.of_day = [summary](const std::string& date, const DayCounts& day) {
    summary->take(date, day);
    return std::string();
  };
  parts.end = [summary, titles_of] { return json_of(*summary, titles_of); };
  return parts;
}

HttpResponse day_by_day(const UsageStatistics& statistics, DayByDay::Parts parts,
                        std::string content_type) {
  HttpResponse response;
  response.content_type = std::move(content_type);
  response.next_piece = [document = std::make_shared<DayByDay>(statistics, std::move(parts))] {
    return document->next();
  };
  return response;
}

/// All days that were kept.
HttpResponse csv(const UsageStatistics& statistics, std::string head,
                 std::function<std::string(const std::string& date, const DayCounts& day)> of_day) {
  return day_by_day(
      statistics,
      {std::move(head), [&statistics] { return statistics.dates(); }, std::move(of_day)},
      "text/csv; charset=utf-8");
}

}  // namespace

HttpResponse VisitsPage::charts(const HttpRequest& request, Shows shows) const {
  return day_by_day(statistics_, summary_parts(request, unix_s_(), titles_of_, std::move(shows)),
                    "application/json");
}

HttpResponse VisitsPage::visits_csv() const {
  return csv(statistics_,
             fmt::format("date,scene,visits,seconds,bytes,{}\r\n", fmt::join(device_names, ",")),
             counts_rows);
}

HttpResponse VisitsPage::stops_csv() const {
  return csv(statistics_, "date,scene,tour,stop,tour title,stop title,visits\r\n",
             [titles_of = titles_of_](const std::string& date, const DayCounts& day) {
               return stops_rows(date, day, titles_of);
             });
}

}  // namespace catgs
