#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace catgs {

/// What messengers and social sites show of a link to a scene.
struct LinkPreview {
  std::string_view site;  // "https://tours.example"
  std::string_view scene_id;
  std::string_view title;
  std::uint64_t gaussians = 0;
  bool has_poster = false;
};

/// Meta elements (Open Graph, Twitter) for the <head> of the page. Everything is escaped: titles
/// are file names, and `site` is what the client called this server.
std::string preview_elements(const LinkPreview& preview);

}  // namespace catgs
