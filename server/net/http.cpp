#include "server/net/http.h"

#include <algorithm>

namespace catgs {

bool origin_allowed(std::string_view origin, std::string_view host,
                    const std::vector<std::string>& allowed) {
  if (origin.empty()) return true;
  if (std::ranges::any_of(allowed, [&](const auto& a) { return a == "*" || a == origin; }))
    return true;
  const auto scheme_end = origin.find("://");
  return scheme_end != std::string_view::npos && origin.substr(scheme_end + 3) == host;
}

std::string content_security_policy(const std::vector<std::string>& embed_origins) {
  std::string policy =
      "default-src 'none'; script-src 'self'; worker-src 'self'; connect-src 'self'; "
      "img-src 'self' blob: data:; style-src 'self'; base-uri 'none'; form-action 'none'; "
      "frame-ancestors";
  if (embed_origins.empty()) policy += " 'none'";
  for (const auto& origin : embed_origins) policy.append(" ").append(origin);
  return policy;
}

}  // namespace catgs
