#include "server/routes.h"

#include <algorithm>
#include <array>
#include <utility>

#include "render_core/base/device_set.h"
#include "server/media/media_type.h"
#include "server/request_handlers.h"
#include "server/scenes/scene_requests.h"
#include "server/scenes/tours.h"

namespace catgs {
namespace {

constexpr std::string_view no_client_page =
    "CaT-GS server: the browser client was not built with this server.\n"
    "Configure with -DCATGS_WEB=ON, or give --client-dir.\n";

// Both ports: probes of the admin port need neither TLS nor a host name.

HttpResponse health(RequestHandlers& handlers, const RouteRequest&) {
  const std::string complaint = handlers.parts.liveness.complaint();
  return complaint.empty() ? text_response(200, "ok\n") : text_response(503, complaint + "\n");
}

HttpResponse readiness(RequestHandlers& handlers, const RouteRequest& request) {
  HttpResponse unhealthy = health(handlers, request);
  if (unhealthy.status != 200) return unhealthy;
  return handlers.parts.ready ? text_response(200, "ready\n") : text_response(503, "not ready\n");
}

// The public port.

HttpResponse front_page(RequestHandlers& handlers, const RouteRequest& request) {
  const StaticFiles& client = handlers.parts.client;
  if (client.empty() && request.http.path == "/")
    return text_response(200, std::string(no_client_page));
  if (client.empty()) return client.respond(request.http);
  return client.respond_with_head(request.http, handlers.scenes.preview(request.http));
}

HttpResponse client_file(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.parts.client.respond(request.http);
}

HttpResponse scene_list(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.scenes.list(request.http);
}

HttpResponse scene_tours(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.scenes.tours(
      request.scene_id, !request.has_pass && request.permit.allows(request.scene_id, Use::save));
}

HttpResponse scene_poster(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.scenes.poster(request.scene_id);
}

HttpResponse walkable_area(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.scenes.walkable_area(request.scene_id, request.http.if_none_match);
}

HttpResponse media_list(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.media.list(request.scene_id);
}

HttpResponse media_pass(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.media.make_pass(request.scene_id, request.permit);
}

HttpResponse media_file(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.media.file(request.http, request.scene_id, std::string(request.parts[1]));
}

std::optional<HttpResponse> refuse_media(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.media.refuse_upload(request.scene_id, request.parts[1]);
}

std::future<HttpResponse> save_media(RequestHandlers& handlers, const RouteRequest& request,
                                     Upload upload) {
  return handlers.media.save(request.http, request.scene_id, std::string(request.parts[1]),
                             std::move(upload.body), std::move(upload.slot));
}

std::future<HttpResponse> save_sidecar(RequestHandlers& handlers, const RouteRequest& request,
                                       Upload upload) {
  return handlers.saver.save(
      request.scene_id, std::move(upload.body),
      {std::string(request.http.if_match), std::string(request.http.if_none_match)},
      std::move(upload.slot));
}

std::future<HttpResponse> order_film(RequestHandlers& handlers, const RouteRequest& request,
                                     Upload upload) {
  return handlers.films.order(request.scene_id, request.permit.token_id, std::move(upload.body),
                              std::move(upload.slot));
}

HttpResponse film_report(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.films.report(request.parts[0]);
}

HttpResponse film_result(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.films.result(request.parts[0]);
}

HttpResponse cancel_film(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.films.cancel(request.parts[0]);
}

std::optional<HttpResponse> refuse_cancel(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.films.refuse_cancel(request.parts[0]);
}

std::future<HttpResponse> take_cancel(RequestHandlers& handlers, const RouteRequest& request,
                                      Upload upload) {
  upload.slot.reset();  // it is free before the answer comes
  std::promise<HttpResponse> answer;
  answer.set_value(cancel_film(handlers, request));
  return answer.get_future();
}

/// The page asks for its document at its own address with ".json" added.
HttpResponse charts_page(RequestHandlers& handlers, const RouteRequest& request) {
  if (!handlers.visits)
    return text_response(404, "404: visits are not counted here: see --visit-counts\n");
  HttpRequest of_file = request.http;
  of_file.path = "/charts.html";
  HttpResponse page = handlers.parts.client.respond(of_file);
  if (page.status == 404)
    return text_response(404, "404: this page was not built; /visits.json has the counts\n");
  // Script and style are inside the page.
  page.policy =
      "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
      "connect-src 'self'; base-uri 'none'; frame-ancestors 'none'";
  return page;
}

/// The counts of the scenes that the sender may save.
HttpResponse own_visit_charts(RequestHandlers& handlers, const RouteRequest& request) {
  if (!handlers.visits) return charts_page(handlers, request);
  const Permit permit = permit_of(handlers.parts.authorize, request.http);
  const auto shows = [permit](const std::string& scene_id) {
    return permit.allows(scene_id, Use::save);
  };
  const auto ids = handlers.parts.scenes.listing();
  if (std::ranges::none_of(*ids, shows, &SceneLibrary::Listing::id))
    return unauthorized(permit.refusal(ids->empty() ? "" : ids->front().id, Use::save)
                            .value_or("there is no scene"));
  return handlers.visits->charts(request.http, shows);
}

// The admin port.

HttpResponse not_here(RequestHandlers&, const RouteRequest&) {
  return text_response(404, "404: /metrics, /visits, /api/metrics and /api/sessions are here\n");
}

Metrics& current_metrics(RequestHandlers& handlers) {
  Metrics& metrics = handlers.parts.metrics;
  for (const auto& [device, views] : handlers.parts.devices.views())
    metrics.set_views(device, views);
  for (const Liveness::Loop& loop : handlers.parts.liveness.loops())
    metrics.set_loop_stalled(std::string(loop.name), loop.stalled);
  return metrics;
}

HttpResponse metrics_text(RequestHandlers& handlers, const RouteRequest&) {
  return text_response(200, current_metrics(handlers).scrape(),
                       "text/plain; version=0.0.4; charset=utf-8");
}

HttpResponse metrics_json(RequestHandlers& handlers, const RouteRequest&) {
  return text_response(200, current_metrics(handlers).json(), "application/json");
}

HttpResponse session_list(RequestHandlers& handlers, const RouteRequest&) {
  return text_response(200, handlers.parts.sessions.published_json(), "application/json");
}

HttpResponse visit_charts(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.visits ? handlers.visits->charts(request.http) : not_here(handlers, request);
}

HttpResponse visits_csv(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.visits ? handlers.visits->visits_csv() : not_here(handlers, request);
}

HttpResponse stops_csv(RequestHandlers& handlers, const RouteRequest& request) {
  return handlers.visits ? handlers.visits->stops_csv() : not_here(handlers, request);
}

using enum HttpMethod;
using enum Right;
constexpr std::string_view media_files = "/api/scenes/{scene...}/media/{name?}";

// Media come first: their names may be those of other rows. Who knows the id of a film's job has
// the right to it. The list of scenes checks each scene by itself.
constexpr auto public_table = std::to_array<Route>({
    {get, "/healthz", no_body, none, health},
    {get, "/readyz", no_body, none, readiness},
    {get, "/api/scenes/{scene...}/media", no_body, save, media_list},
    {get, "/api/scenes/{scene...}/media-pass", no_body, see, media_pass},
    {get, media_files, no_body, see_or_pass, media_file},
    {put, media_files, max_media_bytes, save, {save_media, refuse_media}},
    {get, "/api/scenes", no_body, none, scene_list},
    {get, "/api/scenes/{scene...}/tours", no_body, see_or_pass, scene_tours},
    {get, "/api/scenes/{scene...}/poster.jpg", no_body, see, scene_poster},
    {get, "/api/scenes/{scene...}/walk", no_body, see, walkable_area},
    {put, "/api/scenes/{scene...}/sidecar", max_sent_sidecar_bytes, save, save_sidecar},
    {put, "/api/scenes/{scene...}/films", max_upload_bytes, save, order_film},
    {get, "/api/films/{job}", no_body, none, film_report},
    {get, "/api/films/{job}/file", no_body, none, film_result},
    {delete_, "/api/films/{job}", no_body, none, cancel_film},
    {put, "/api/films/{job}/cancel", max_sent_sidecar_bytes, none, {take_cancel, refuse_cancel}},
    {get, "/visits", no_body, none, charts_page},
    {get, "/visits.json", no_body, none, own_visit_charts},
    {get, "/", no_body, none, front_page},
    {get, "/index.html", no_body, none, front_page},
    {get, "{path...}", no_body, none, client_file},
});

constexpr auto admin_table = std::to_array<Route>({
    {get, "/healthz", no_body, none, health},
    {get, "/readyz", no_body, none, readiness},
    {get, "/metrics", no_body, none, metrics_text},
    {get, "/api/metrics", no_body, none, metrics_json},
    {get, "/api/sessions", no_body, none, session_list},
    {get, "/visits", no_body, none, charts_page},
    {get, "/visits.json", no_body, none, visit_charts},
    {get, "/visits.csv", no_body, none, visits_csv},
    {get, "/visits/stops.csv", no_body, none, stops_csv},
    {get, "{path...}", no_body, none, not_here},
});

// A row that shows a scene says who may see it, and a PUT has a limit.
constexpr bool is_whole(const Route& route) {
  const bool names_scene = route.path.starts_with("/api/scenes/{scene...}");
  const bool is_put = route.method == put;
  return names_scene == (route.right != none) && is_put == (route.most_bytes > 0) &&
         is_put == (route.handler.take != nullptr) && is_put == (route.handler.answer == nullptr);
}
static_assert(std::ranges::all_of(public_table, is_whole));
static_assert(std::ranges::all_of(admin_table, is_whole));

}  // namespace

std::span<const Route> public_routes() { return public_table; }
std::span<const Route> admin_routes() { return admin_table; }

const Route* find_route(std::span<const Route> routes, HttpMethod method, std::string_view path) {
  const auto found = std::ranges::find_if(routes, [&](const Route& route) {
    return route.method == method && match_path(route.path, path).has_value();
  });
  return found == routes.end() ? nullptr : &*found;
}

}  // namespace catgs
