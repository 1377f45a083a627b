#include "server/router.h"

#include <utility>

#include "server/request_handlers.h"
#include "server/scenes/scene_requests.h"

namespace catgs {
namespace {

constexpr std::size_t most_refused_bytes = 1 << 20;  // that a PUT to no route may announce

}  // namespace

HttpResponse Router::respond(const HttpRequest& request) const {
  const Route* route = find_route(routes_, request.method, request.path);
  if (!route) return text_response(404, "404: there is no such page\n");
  const RouteRequest of_route = routed(*route, request);
  if (auto refusal = refuse_sender(*route, of_route)) return *std::move(refusal);
  return route->handler.answer(handlers_, of_route);
}

bool Router::serves_delete(std::string_view path) const {
  return find_route(routes_, HttpMethod::delete_, path) != nullptr;
}

std::size_t Router::most_bytes(std::string_view path) const {
  const Route* route = find_route(routes_, HttpMethod::put, path);
  return route ? route->most_bytes : most_refused_bytes;
}

std::optional<HttpResponse> Router::refuse_upload(const HttpRequest& request) const {
  const Route* route = find_route(routes_, HttpMethod::put, request.path);
  if (!route)
    return text_response(
        405, "405: only sidecars and media of scenes, and orders of films, are taken here\n");
  const RouteRequest of_route = routed(*route, request);
  if (auto refusal = refuse_sender(*route, of_route)) return refusal;
  const auto refuse = route->handler.refuse;
  return refuse ? refuse(handlers_, of_route) : std::nullopt;
}

std::future<HttpResponse> Router::take_upload(const HttpRequest& request, std::string body,
                                              std::shared_ptr<const UploadSlot> slot) const {
  const Route& route = *find_route(routes_, HttpMethod::put, request.path);
  return route.handler.take(handlers_, routed(route, request), {std::move(body), std::move(slot)});
}

RouteRequest Router::routed(const Route& route, const HttpRequest& request) const {
  RouteRequest out{.http = request, .parts = *match_path(route.path, request.path)};
  if (route.right == Right::none) return out;
  out.scene_id = handlers_.parts.scenes.resolve(out.parts[0]);
  out.has_pass =
      route.right == Right::see_or_pass && handlers_.media.has_pass(request, out.scene_id);
  if (!out.has_pass) out.permit = permit_of(handlers_.parts.authorize, request);
  return out;
}

std::optional<HttpResponse> Router::refuse_sender(const Route& route,
                                                  const RouteRequest& request) const {
  if (route.right == Right::none || request.has_pass) return std::nullopt;
  return refuse_use(handlers_.parts.scenes, request.permit, request.scene_id,
                    route.right == Right::save ? Use::save : Use::list);
}

}  // namespace catgs
