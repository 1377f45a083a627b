#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render_core/scene/files/tour_titles.h"
#include "server/counts/visit_book.h"
#include "server/net/http.h"

namespace catgs {

/// The counts on the admin port: "/visits.json", which charts.html shows as "/visits",
/// "/visits.csv" and "/visits/stops.csv". Network thread. Days are read while an answer is sent,
/// one at a time, on other threads.
class VisitsPage {
 public:
  using Titles = std::shared_ptr<const std::vector<TourTitles>>;
  /// Any thread. Of the tours of a scene; null where they are not known.
  using TitlesOf = std::function<Titles(const std::string& scene_id)>;

  /// All outlive the page and its answers.
  VisitsPage(const VisitBook& book, std::function<std::int64_t()> unix_s, TitlesOf titles_of)
      : book_(book), unix_s_(std::move(unix_s)), titles_of_(std::move(titles_of)) {}

  /// Returns nothing for any other path. The query may have `scene`, an id, and `days`.
  [[nodiscard]] std::optional<HttpResponse> respond(const HttpRequest& request) const;

 private:
  const VisitBook& book_;
  const std::function<std::int64_t()> unix_s_;
  const TitlesOf titles_of_;
};

}  // namespace catgs
