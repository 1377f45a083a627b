#pragma once

#include <cstddef>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "server/net/http.h"
#include "server/routes.h"

namespace catgs {

/// Finds the route of each request, checks the right that its row asks for and calls its functions.
/// Network thread.
class Router {
 public:
  /// Both outlive this object.
  Router(std::span<const Route> routes, RequestHandlers& handlers)
      : routes_(routes), handlers_(handlers) {}

  [[nodiscard]] HttpResponse respond(const HttpRequest& request) const;
  [[nodiscard]] bool serves_delete(std::string_view path) const;

  // See HttpUploads.
  [[nodiscard]] std::size_t most_bytes(std::string_view path) const;
  [[nodiscard]] std::optional<HttpResponse> refuse_upload(const HttpRequest& request) const;
  [[nodiscard]] std::future<HttpResponse> take_upload(const HttpRequest& request, std::string body,
                                                      std::shared_ptr<const UploadSlot> slot) const;

 private:
  /// With the permit of the request's token, if the route asks for one.
  [[nodiscard]] RouteRequest routed(const Route& route, const HttpRequest& request) const;
  /// Returns why the sender may not use the scene; nothing: it may.
  [[nodiscard]] std::optional<HttpResponse> refuse_sender(const Route& route,
                                                          const RouteRequest& request) const;

  const std::span<const Route> routes_;
  RequestHandlers& handlers_;
};

}  // namespace catgs
