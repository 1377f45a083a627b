#include "server/scenes/scene_requests.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "server/base/scene_id.h"

namespace catgs {

Permit permit_of(const Authorize& authorize, const HttpRequest& request) {
  return authorize(std::string(request.token));
}

HttpResponse json_response(std::shared_ptr<const std::string> body) {
  HttpResponse response;
  response.content_type = "application/json";
  response.body = std::move(body);
  return response;
}

HttpResponse unauthorized(std::string_view why) {
  return text_response(401, fmt::format("401: {}\nSend it as Authorization: Bearer TOKEN\n", why));
}

std::optional<HttpResponse> refuse_use(const SceneLibrary& scenes, const Permit& permit,
                                       std::string_view scene_id, Use use) {
  if (const auto refused = permit.refusal(scene_id, Use::list)) return unauthorized(*refused);
  if (const auto refused = permit.refusal(scene_id, use))
    return text_response(403, "403: " + *refused + "\n");
  if (use != Use::save) return std::nullopt;
  if (std::ranges::count(*scenes.listing(), scene_id, &SceneLibrary::Listing::id) == 0)
    return text_response(404, "404: " + no_such_scene(scene_id) + "\n");
  return std::nullopt;
}

}  // namespace catgs
