#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "render_core/scene/scene_about.h"

namespace catgs {

/// The facts that messengers and social sites show for a link to a scene.
struct LinkPreview {
  std::string_view site;  // "https://tours.example"
  std::string_view scene_id;
  std::string_view title;
  SceneAbout about{};
  std::uint64_t gaussians = 0;
  bool has_poster = false;
};

/// Meta elements (Open Graph, Twitter) for the <head> of the page. All values are escaped: titles
/// are file names, and `site` is the client's name for this server.
std::string preview_elements(const LinkPreview& preview);

}  // namespace catgs
