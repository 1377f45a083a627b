#include "server/scenes/scene_api.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "server/base/scene_id.h"
#include "server/scenes/link_preview.h"
#include "server/scenes/scene_requests.h"

namespace catgs {
namespace {

/// {"de": {"title": …, "credits": …}}
nlohmann::json json_of(const std::vector<SceneWords>& translations) {
  auto languages = nlohmann::json::object();
  for (const auto& [language, title, credits] : translations)
    languages[language] = {{"title", title}, {"credits", credits}};
  return languages;
}

/// Builds the answer to "GET /api/scenes".
std::shared_ptr<const std::string> scene_list(
    const std::vector<const SceneLibrary::Listing*>& scenes) {
  auto list = nlohmann::json::array();
  for (const auto* scene : scenes) {
    list.push_back({{"id", scene->id},
                    {"title", scene->title},
                    {"credits", scene->about.credits},
                    {"licence", scene->about.licence},
                    {"gaussians", scene->gaussians},
                    {"loaded", scene->loaded}});
    if (!scene->state.empty()) list.back()["state"] = scene->state;
    if (!scene->about.translations.empty())
      list.back()["translations"] = json_of(scene->about.translations);
  }
  return std::make_shared<const std::string>(nlohmann::json{{"scenes", list}}.dump());
}

}  // namespace

/// Only for scenes that are shown without a token. Programs that make previews have no token, and a
/// preview must not reveal more than the page.
std::string SceneApi::preview(const HttpRequest& request) {
  constexpr std::string_view name = "scene=";
  const auto argument = std::ranges::find_if(
      request.arguments, [&](const std::string& text) { return text.starts_with(name); });
  const auto listing = scenes_.listing();
  const auto scene =
      argument == request.arguments.end()
          ? listing->begin()
          : std::ranges::find(*listing, scenes_.resolve(argument->substr(name.size())),
                              &SceneLibrary::Listing::id);
  if (scene == listing->end() || !authorize_("").allows(scene->id, Use::own_session)) return {};
  return preview_elements({request.site, scene->id, scene->title, scene->about, scene->gaussians,
                           scene->poster != nullptr});
}

/// Lists the scenes that the permit allows. Like hello, the list tells strangers nothing about
/// other scenes.
HttpResponse SceneApi::list(const HttpRequest& request) {
  const Permit permit = permit_of(authorize_, request);
  const auto listing = scenes_.listing();
  std::vector<const SceneLibrary::Listing*> shown;
  Refusal refusal = listing->empty() ? permit.refusal({}, Use::list) : std::nullopt;
  for (const auto& scene : *listing) {
    if (auto refused = permit.refusal(scene.id, Use::list))
      refusal = std::move(refused);
    else
      shown.push_back(&scene);
  }
  if (shown.empty() && refusal) return unauthorized(*refusal);
  if (shown.size() < listing->size()) return json_response(scene_list(shown));
  if (listed_.lock() != listing) {
    listed_ = listing;
    whole_list_ = scene_list(shown);
  }
  return json_response(whole_list_);
}

template <typename Answer>
HttpResponse SceneApi::about(std::string_view scene_id, const Answer& answer) {
  const auto listing = scenes_.listing();
  const auto found = std::ranges::find(*listing, scene_id, &SceneLibrary::Listing::id);
  if (found == listing->end()) return text_response(404, "404: " + no_such_scene(scene_id) + "\n");
  return answer(*found);
}

HttpResponse SceneApi::tours(std::string_view scene_id, bool may_save) {
  return about(scene_id, [&](const SceneLibrary::Listing& scene) {
    static const ToursAnswers none;
    const ToursAnswers& tours = scene.tours ? *scene.tours : none;
    return json_response(may_save ? tours.for_authors : tours.for_viewers);
  });
}

HttpResponse SceneApi::poster(std::string_view scene_id) {
  return about(scene_id, [&](const SceneLibrary::Listing& scene) {
    HttpResponse response;
    if (!scene.poster && scene.loaded) return text_response(404, "404: the scene has no poster\n");
    if (!scene.poster) {
      scenes_.want_poster(scene.id);
      // No error: browsers would report that to visitors who look at the console.
      response = text_response(202, "202: the poster comes when the scene is loaded\n");
      response.retry_after_s = 5;
      return response;
    }
    response.content_type = "image/jpeg";
    response.cache_control = "private, max-age=60";
    response.body = scene.poster;
    return response;
  });
}

HttpResponse SceneApi::walkable_area(std::string_view scene_id, std::string_view if_none_match) {
  return about(scene_id, [&](const SceneLibrary::Listing& scene) {
    return walkable_area_of(scene, if_none_match);
  });
}

/// Neither an unfinished search nor a scene without walkable area is an error, which browsers
/// would report to visitors who look at the console.
HttpResponse SceneApi::walkable_area_of(const SceneLibrary::Listing& scene,
                                        std::string_view if_none_match) {
  constexpr int retry_after_s = 3;
  HttpResponse response;
  if (!scene.walkable_area && !scene.loaded) {
    response = text_response(404, "404: the scene is not loaded yet\n");
    response.retry_after_s = retry_after_s;
    return response;
  }
  if (!scene.walkable_area) {
    scenes_.want_walkable_area(scene.id);
    response = text_response(202, "202: the walkable area is being computed\n");
    response.retry_after_s = retry_after_s;
    return response;
  }
  if (!scene.walkable_area->file) {
    response.status = 204;
    return response;
  }
  response.content_type = "application/octet-stream";
  response.cache_control = "private, no-cache";  // kept, and asked for again by its tag
  response.etag = scene.walkable_area->etag;
  if (if_none_match == response.etag)
    response.status = 304;
  else
    response.body = scene.walkable_area->file;
  return response;
}

}  // namespace catgs
