#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/access/authorize.h"
#include "server/net/http.h"
#include "server/scenes/scene_library.h"

namespace catgs {

/// The permit of the request's token; that of no token if there is none.
Permit permit_of(const Authorize& authorize, const HttpRequest& request);

HttpResponse json_response(std::shared_ptr<const std::string> body);

/// Status 401. `why`: the refusal of a permit.
HttpResponse unauthorized(std::string_view why);

/// Refuses a request to use a scene by a permit that does not allow that, or to save a scene that
/// is not there; nothing: continue.
std::optional<HttpResponse> refuse_use(const SceneLibrary& scenes, const Permit& permit,
                                       std::string_view scene_id, Use use);

}  // namespace catgs
