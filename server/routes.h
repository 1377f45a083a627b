#pragma once

#include <cstddef>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "server/access/authorize.h"
#include "server/net/http.h"
#include "server/net/path_pattern.h"
#include "server/net/upload_slots.h"

namespace catgs {

struct RequestHandlers;

/// A request whose route is known and whose sender has the route's right.
struct RouteRequest {
  const HttpRequest& http;
  PathParts parts{};       // what the route's path names, in its order
  std::string scene_id{};  // empty: the path names no scene
  Permit permit{};         // of its token; of a path without a scene, or with a pass: empty
  bool has_pass = false;   // to the scene's tours and media
};

struct Upload {
  std::string body;
  std::shared_ptr<const UploadSlot> slot;
};

/// The right to the scene in the path that a token must give its sender.
enum class Right {
  none,  // the path names no scene
  see,
  see_or_pass,  // a pass to the scene's tours and media does as well
  save,
};

/// Called on the network thread; must not block.
struct RouteHandler {
  using Answer = HttpResponse (*)(RequestHandlers&, const RouteRequest&);
  /// See HttpUploads::take.
  using Take = std::future<HttpResponse> (*)(RequestHandlers&, const RouteRequest&, Upload);
  /// Refuses a PUT by its head, for another reason than its sender, or returns nothing.
  using Refuse = std::optional<HttpResponse> (*)(RequestHandlers&, const RouteRequest&);

  constexpr RouteHandler(Answer function) : answer(function) {}
  constexpr RouteHandler(Take function, Refuse refusal = nullptr)
      : take(function), refuse(refusal) {}

  Answer answer = nullptr;  // GET and DELETE
  Take take = nullptr;      // PUT
  Refuse refuse = nullptr;  // null: never
};

/// One URL: a row of a table.
struct Route {
  HttpMethod method;
  std::string_view path;   // a pattern of path_pattern.h
  std::size_t most_bytes;  // of its body; no_body: it has none
  Right right;
  RouteHandler handler;
};
inline constexpr std::size_t no_body = 0;

/// The URLs of each port. The first row that matches a request is its route.
std::span<const Route> public_routes();
std::span<const Route> admin_routes();

/// Returns null if no row matches.
const Route* find_route(std::span<const Route> routes, HttpMethod method, std::string_view path);

}  // namespace catgs
