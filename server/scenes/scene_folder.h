#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "render_core/scene/files/scene_size.h"
#include "render_core/scene/scene_about.h"
#include "server/scenes/scene_ids.h"

namespace catgs {

/// By which a scan sees that the files of a scene have changed. Times alone do not tell it: copies
/// may keep the times of their originals.
struct FilesStamp {
  std::filesystem::file_time_type newest;
  std::uintmax_t bytes = 0;  // of all files
  bool operator==(const FilesStamp&) const = default;
};

/// A scene as described by its headers.
struct FoundScene {
  SceneLocation location;
  std::string name;  // for people
  std::string id;
  SceneSize size;
  SceneAbout about;  // of its sidecar, when these files were found
  /// The stamp of the file, and of those that it has beside it or directly in its folder. A new
  /// value means a new scene.
  FilesStamp stamp{};
  std::string tree{};  // tree_name(), for a scene that may get one; else empty
};

/// Options of a scan of folders.
struct SceneScanOptions {
  SceneIds ids;
  LoadOptions levels;  // see read_scene_size()
  bool names_trees = false;
};

/// Reads the headers of a scene; `stamp` is left to the caller. Throws InputError.
FoundScene read_scene_headers(const SceneLocation& location, const SceneScanOptions& options);

/// Scans folders for scenes repeatedly. Only headers of new and changed scenes are read, because a
/// folder may be a slow mount of an object store. Not thread-safe.
class SceneFolders {
 public:
  /// `elsewhere`: scene_key() of scenes that are offered anyway.
  SceneFolders(std::vector<std::filesystem::path> folders, SceneScanOptions options,
               std::set<std::string> elsewhere = {})
      : folders_(std::move(folders)),
        scan_options_(std::move(options)),
        elsewhere_(std::move(elsewhere)) {}

  /// Lists the present scenes in order of path: scene files, SOG folders and training output
  /// folders directly in the folders. At most max_scenes are listed; a warning names further ones.
  /// Unreadable scenes are left out and reported once. A scene is listed once, even if its folder
  /// is named twice or by a symbolic link, too. Throws InputError if a folder itself cannot be
  /// read.
  std::vector<FoundScene> scan();

  static constexpr std::size_t max_scenes = 10'000;

 private:
  struct Known {
    FilesStamp stamp;
    std::vector<std::filesystem::path> beside;  // files_beside()
    bool good = false;
    FoundScene scene;
  };
  std::vector<std::filesystem::path> list() const;

  const std::vector<std::filesystem::path> folders_;
  const SceneScanOptions scan_options_;
  const std::set<std::string> elsewhere_;
  std::map<std::filesystem::path, Known> known_;
  bool told_of_too_many_ = false;
};

}  // namespace catgs
