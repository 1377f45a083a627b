#include "server/request_handlers.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>

#include "server/base/clock.h"

namespace catgs {

StaticFiles find_client(const std::string& client_dir) {
  const auto folder = client_dir.empty() ? built_client() : std::filesystem::path(client_dir);
  return folder.empty() ? StaticFiles() : StaticFiles(folder);
}

RequestHandlers::RequestHandlers(Parts around)
    : parts(std::move(around)),
      scenes(parts.scenes, parts.authorize),
      media({parts.scenes, parts.background,
             [this](std::string_view token_id) { return parts.access.ended(token_id); },
             SessionTokens(parts.access.own_key()), unix_now_s}),
      saver(parts.scenes, parts.background, parts.io, parts.config.media_origins),
      films({parts.io, parts.background,
             [this](const auto& id, bool again) { return parts.scenes.lease(id, again); },
             [this] { return parts.sessions.anybody_looks(); },
             [this](std::string_view token_id) { return parts.access.ended(token_id); }}) {
  if (parts.statistics)
    visits.emplace(*parts.statistics, unix_now_s, [this](const std::string& scene_id) {
      const auto listing = parts.scenes.listing();
      const auto scene = std::ranges::find(*listing, scene_id, &SceneLibrary::Listing::id);
      if (scene == listing->end()) return VisitsPage::Titles();
      return VisitsPage::Titles{scene->title, scene->tours ? scene->tours->titles : nullptr};
    });
  if (!parts.config.token_key_file.empty()) remove_stale_files();  // others save nothing
}

void RequestHandlers::remove_stale_files() {
  const auto& configured = parts.config.scene_folders;
  std::set<std::filesystem::path> folders(configured.begin(), configured.end());
  for (const auto& scene : *parts.scenes.listing())
    if (!scene.sidecar.empty()) folders.insert(scene.sidecar.parent_path());
  saver.remove_stale_files_in(std::move(folders));
}

}  // namespace catgs
