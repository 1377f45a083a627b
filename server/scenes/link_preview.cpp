#include "server/scenes/link_preview.h"

#include <fmt/format.h>

#include "server/net/http.h"
#include "server/scenes/poster.h"

namespace catgs {
std::string preview_elements(const LinkPreview& preview) {
  std::string out;
  const auto add = [&](std::string_view kind, std::string_view name, std::string_view content) {
    out += fmt::format("<meta {}=\"{}\" content=\"{}\" />\n", kind, name, escape_html(content));
  };
  add("property", "og:type", "website");
  add("property", "og:title", preview.title);
  std::string description = fmt::format(
      "Walk through this 3D capture of {} Gaussians in your browser.", preview.gaussians);
  for (const std::string& said : {preview.about.credits, preview.about.licence})
    if (!said.empty()) description += fmt::format(" {}.", said);
  add("property", "og:description", description);
  if (!preview.has_poster || preview.site.empty()) return out;
  add("property", "og:image",
      fmt::format("{}/api/scenes/{}/poster.jpg", preview.site, percent_encoded(preview.scene_id)));
  add("property", "og:image:width", std::to_string(poster_size_px.x));
  add("property", "og:image:height", std::to_string(poster_size_px.y));
  add("name", "twitter:card", "summary_large_image");
  return out;
}

}  // namespace catgs
