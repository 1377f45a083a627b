#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/counts/visit_counts.h"
#include "server/net/http.h"

namespace catgs {

/// A tour's stops, as its author calls them.
struct TourTitles {
  std::string tour;
  std::vector<std::string> stops;
};

/// The titles in an answer of /api/scenes/ID/tours. Tours without stops are left out, as pages do.
std::vector<TourTitles> titles_of_tours(const std::string& answer);

/// The pages of the admin port that show VisitCounts: "/visits", "/visits.csv" and
/// "/visits/stops.csv". Any thread.
class VisitsPage {
 public:
  /// `titles`: of the tours of a scene; empty where they are not known. `counts` outlives the page.
  VisitsPage(const VisitCounts& counts, std::function<std::int64_t()> unix_s,
             std::function<std::vector<TourTitles>(const std::string& scene_id)> titles)
      : counts_(counts), unix_s_(std::move(unix_s)), titles_(std::move(titles)) {}

  /// Returns nothing for any other path. The query may have `scene`, an id, and `days`.
  [[nodiscard]] std::optional<HttpResponse> respond(const HttpRequest& request) const;

 private:
  [[nodiscard]] std::string html(const HttpRequest& request) const;
  [[nodiscard]] std::string stops_csv() const;

  const VisitCounts& counts_;
  const std::function<std::int64_t()> unix_s_;
  const std::function<std::vector<TourTitles>(const std::string& scene_id)> titles_;
};

}  // namespace catgs
