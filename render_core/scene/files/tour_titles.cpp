#include "render_core/scene/files/tour_titles.h"

#include <utility>

#include <nlohmann/json.hpp>

namespace catgs {
namespace {

using nlohmann::json;

const json& member(const json& of, const char* name) {
  static const json nothing;
  const auto found = of.is_object() ? of.find(name) : of.end();
  return found == of.end() ? nothing : *found;
}

std::string title_of(const json& item) {
  const json& title = member(item, "title");
  return title.is_string() ? title.get<std::string>() : std::string();
}

void add_tour(std::string title, const json& stops, std::vector<TourTitles>& titles) {
  if (!stops.is_array() || stops.empty()) return;
  TourTitles tour{std::move(title), {}};
  for (const json& stop : stops) tour.stops.push_back(title_of(stop));
  titles.push_back(std::move(tour));
}

}  // namespace

std::vector<TourTitles> titles_of_tours(std::string_view document) {
  const json root = json::parse(document, nullptr, false);
  const json& tours = member(root, "tours");
  std::vector<TourTitles> titles;
  if (tours.is_array())
    for (const json& tour : tours) add_tour(title_of(tour), member(tour, "stops"), titles);
  else
    add_tour("", member(member(root, "settings"), "annotations"), titles);
  return titles;
}

}  // namespace catgs
