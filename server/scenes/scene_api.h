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

/// Answers requests for "/api/scenes" and paths below it on the public port. Network thread.
class SceneApi {
 public:
  /// `scenes` must outlive this object.
  SceneApi(SceneLibrary& scenes, Authorize authorize)
      : scenes_(scenes), authorize_(std::move(authorize)) {}

  /// Returns nothing for any other path.
  std::optional<HttpResponse> respond(const HttpRequest& request);
  /// The elements of the page's head that messengers show for a link; empty: none.
  std::string preview(const HttpRequest& request);
  /// Returns the refusal of a request "PUT /api/scenes/ID/sidecar" or "…/films", or nothing if its
  /// sender may save.
  std::optional<HttpResponse> refuse_upload(const HttpRequest& request);
  /// The id of the scene that an accepted request saves, or orders a film of.
  [[nodiscard]] std::string saved_scene(const HttpRequest& request) const;
  /// The id of the token that an accepted request came with.
  [[nodiscard]] std::string author_of(const HttpRequest& request) const;
  /// True if the request orders a film.
  [[nodiscard]] static bool orders_film(const HttpRequest& request);

 private:
  enum class Part { tours, poster, walk };
  HttpResponse list_scenes(const Permit& permit);
  HttpResponse part_of_scene(std::string_view scene_id, Part part, const HttpRequest& request);
  HttpResponse ground_of(const SceneLibrary::Listing& scene, std::string_view if_none_match);

  SceneLibrary& scenes_;
  const Authorize authorize_;
  // The cached answer for clients that may see every scene of a listing.
  std::weak_ptr<const std::vector<SceneLibrary::Listing>> listed_;
  std::shared_ptr<const std::string> whole_list_;
};

}  // namespace catgs
