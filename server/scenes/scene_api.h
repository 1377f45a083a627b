#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/access/authorize.h"
#include "server/net/http.h"
#include "server/scenes/scene_library.h"

namespace catgs {

/// Answers requests about scenes, whose senders may see them (routes.h). Network thread.
class SceneApi {
 public:
  /// `scenes` must outlive this object.
  SceneApi(SceneLibrary& scenes, Authorize authorize)
      : scenes_(scenes), authorize_(std::move(authorize)) {}

  /// The scenes that the request's token allows.
  HttpResponse list(const HttpRequest& request);
  HttpResponse tours(std::string_view scene_id, bool may_save);
  HttpResponse poster(std::string_view scene_id);
  HttpResponse walkable_area(std::string_view scene_id, std::string_view if_none_match);
  /// The elements of the page's head that messengers show for a link; empty: none.
  std::string preview(const HttpRequest& request);

 private:
  HttpResponse walkable_area_of(const SceneLibrary::Listing& scene, std::string_view if_none_match);
  /// Returns what `answer` makes of a scene of the listing, or status 404.
  template <typename Answer>
  HttpResponse about(std::string_view scene_id, const Answer& answer);

  SceneLibrary& scenes_;
  const Authorize authorize_;
  // The cached answer for clients that may see every scene of a listing.
  std::weak_ptr<const std::vector<SceneLibrary::Listing>> listed_;
  std::shared_ptr<const std::string> whole_list_;
};

}  // namespace catgs
