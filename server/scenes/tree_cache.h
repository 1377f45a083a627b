#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <string_view>

#include "render_core/scene/files/load_scene.h"
#include "server/base/file_lock.h"

namespace catgs {

/// The name of a scene's tree in a cache: "hall-3f0c91d2-9b1deb4d3b7d4bad.tree". The first digest
/// is of the scene's path. The second one changes with its files (path, number, sizes, newest
/// time), with the levels that are chosen of it, and with the format of trees. Sidecars do not
/// count. Reads the names, sizes and times of the scene's files. Throws InputError.
std::string tree_name(const SceneLocation& scene, const LoadOptions& levels);

/// The trees in a folder. Files of other names are left alone. Not thread-safe.
class TreeCache {
 public:
  /// Makes the folder if needed, and removes what builds that were killed have left. The folder
  /// belongs to this process as long as the cache exists. Throws InputError that names --cache-dir
  /// if the folder cannot be written, or belongs to another process.
  explicit TreeCache(std::filesystem::path folder);

  [[nodiscard]] std::filesystem::path path_of(std::string_view name) const {
    return folder_ / name;
  }
  [[nodiscard]] bool contains(const std::string& name) const { return names_.contains(name); }
  /// The tree is in the folder now.
  void add(const std::string& name) { names_.insert(name); }
  void remove(const std::string& name);
  /// Removes the trees that the present scenes do not need. `names`: of the trees of these scenes.
  /// Other trees of a present scene are of other content, and go at once. Trees of absent scenes go
  /// a week after they were last present, because a folder may be away for a while.
  void keep(const std::set<std::string>& names);

 private:
  const std::filesystem::path folder_;
  const FileLock lock_;
  std::set<std::string> names_;
};

}  // namespace catgs
