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

/// The counts, of all scenes or of those whose author asks. Network thread. Days are read while an
/// answer is sent, one at a time, on other threads.
class VisitsPage {
 public:
  struct Titles {
    std::string scene{};                                     // empty: it is not known
    std::shared_ptr<const std::vector<TourTitles>> tours{};  // null: they are not known
  };
  /// Any thread.
  using TitlesOf = std::function<Titles(const std::string& scene_id)>;
  /// Any thread. Whether a scene is shown.
  using Shows = std::function<bool(const std::string& scene_id)>;

  /// All outlive the page and its answers.
  VisitsPage(const UsageStatistics& statistics, std::function<std::int64_t()> unix_s,
             TitlesOf titles_of)
      : statistics_(statistics), unix_s_(std::move(unix_s)), titles_of_(std::move(titles_of)) {}

  /// The document that charts.html shows. The query may have `scene`, an id, and `days`.
  /// `shows`: empty: all scenes are shown, and the files of all.
  [[nodiscard]] HttpResponse charts(const HttpRequest& request, Shows shows = {}) const;
  [[nodiscard]] HttpResponse visits_csv() const;
  [[nodiscard]] HttpResponse stops_csv() const;

 private:
  const UsageStatistics& statistics_;
  const std::function<std::int64_t()> unix_s_;
  const TitlesOf titles_of_;
};

}  // namespace catgs
