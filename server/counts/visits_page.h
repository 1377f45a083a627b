#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "render_core/scene/files/tour_titles.h"
#include "server/counts/usage_statistics.h"
#include "server/net/http.h"

namespace catgs {

/// The counts on the admin port. Network thread. Days are read while an answer is sent, one at a
/// time, on other threads.
class VisitsPage {
 public:
  using Titles = std::shared_ptr<const std::vector<TourTitles>>;
  /// Any thread. Of the tours of a scene; null where they are not known.
  using TitlesOf = std::function<Titles(const std::string& scene_id)>;

  /// All outlive the page and its answers.
  VisitsPage(const UsageStatistics& statistics, std::function<std::int64_t()> unix_s,
             TitlesOf titles_of)
      : statistics_(statistics), unix_s_(std::move(unix_s)), titles_of_(std::move(titles_of)) {}

  /// The document that charts.html shows. The query may have `scene`, an id, and `days`.
  [[nodiscard]] HttpResponse charts(const HttpRequest& request) const;
  [[nodiscard]] HttpResponse visits_csv() const;
  [[nodiscard]] HttpResponse stops_csv() const;

 private:
  const UsageStatistics& statistics_;
  const std::function<std::int64_t()> unix_s_;
  const TitlesOf titles_of_;
};

}  // namespace catgs
