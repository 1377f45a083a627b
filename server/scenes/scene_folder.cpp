#include "server/scenes/scene_folder.h"

#include <algorithm>
#include <set>
#include <system_error>
#include <utility>

#include "render_core/base/error.h"
#include "render_core/base/printable.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/formats/json_field.h"
#include "server/base/log_event.h"
#include "server/media/media_folder.h"
#include "server/scenes/derived_files.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

bool is_hidden(const fs::path& path) { return path.filename().string().starts_with('.'); }

/// True if a folder looks like a scene. People keep other folders beside their scenes.
bool is_scene_folder(const fs::path& path) {
  std::error_code error;
  if (path.extension() == media_folder_extension) return false;
  return has_scene_index(path) || fs::is_directory(path / "point_cloud", error);
}

/// Empty if the sidecar is missing. A faulty one is reported when the scene is loaded.
SceneAbout about_in(const fs::path& sidecar) {
  std::error_code error;
  try {
    if (fs::is_regular_file(sidecar, error)) return read_sidecar(FileSource(sidecar)).about;
  } catch (const InputError&) {
  }
  return {};
}

/// The files of a folder may be replaced one by one or all at once.
FilesStamp stamp_of(const fs::path& path, const std::vector<fs::path>& beside) {
  FilesStamp stamp{.newest = fs::file_time_type::min()};
  const auto add = [&](const fs::path& file) {
    std::error_code error;
    stamp.newest = std::max(stamp.newest, fs::last_write_time(file, error));
    const std::uintmax_t bytes = fs::is_regular_file(file, error) ? fs::file_size(file, error) : 0;
    if (!error) stamp.bytes += bytes;
  };
  add(path);
  std::error_code error;
  if (fs::is_directory(path, error))
    for (const auto& entry : fs::directory_iterator(path, error)) add(entry.path());
  for (const fs::path& file : beside) add(file);
  return stamp;
}

}  // namespace

FoundScene read_scene_headers(const SceneLocation& location, const SceneScanOptions& options) {
  FoundScene found;
  found.location = location;
  found.name = printable(to_utf8(location.name));
  found.id = options.ids.id_of(location.given.string(), found.name);
  const LoadOptions levels = location.has_levels() ? options.levels : LoadOptions();
  found.size = read_scene_size(location, levels);
  found.about = about_in(location.hints.sidecar);
  if (options.names_trees && !found.size.in_pages) found.tree = tree_name(location, levels);
  return found;
}

std::vector<fs::path> SceneFolders::list() const {
  std::vector<fs::path> paths;
  std::set<fs::path> listed;
  for (const fs::path& folder : folders_) {
    std::error_code error;
    if (!listed.insert(fs::canonical(folder, error)).second && !error) continue;
    fs::directory_iterator entries(folder, error);
    if (error)
      throw InputError("--scene-folder " + folder.string(), {}, error.message(),
                       "name a folder that the server may read");
    for (const auto& entry : entries) {
      const bool scene =
          entry.is_directory(error) ? is_scene_folder(entry.path()) : is_scene_name(entry.path());
      if (scene && !is_hidden(entry.path())) paths.push_back(entry.path());
    }
  }
  std::ranges::sort(paths);
  return paths;
}

std::vector<FoundScene> SceneFolders::scan() {
  std::vector<fs::path> paths = list();
  if (paths.size() > max_scenes) {
    if (!std::exchange(told_of_too_many_, true))
      log_warning({.event = "too_many_scenes"},
                  "--scene-folder: {} scenes are too many, the first {} are offered", paths.size(),
                  max_scenes);
    paths.resize(max_scenes);
  }
  std::map<fs::path, Known> known;
  std::vector<FoundScene> scenes;
  std::set<std::string> keys = elsewhere_;
  for (const fs::path& path : paths) {
    const auto before = known_.find(path);
    Known& now = known[path];
    if (before != known_.end() && before->second.stamp == stamp_of(path, before->second.beside)) {
      now = std::move(before->second);
    } else {
      now.beside = files_beside(path);
      now.stamp = stamp_of(path, now.beside);
      try {
        now.scene = read_scene_headers(locate_scene(path), scan_options_);
        now.scene.stamp = now.stamp;
        now.good = true;
      } catch (
          const std::exception& error) {  // it may be half copied: its next change is read again
        log_warning({.event = "scene_not_offered"}, "not offered: {}", error.what());
      }
    }
    if (now.good && keys.insert(scene_key(path.string())).second) scenes.push_back(now.scene);
  }
  known_ = std::move(known);
  return scenes;
}

}  // namespace catgs
