#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace catgs {

/// True if --scene names a procedural scene, synth:KIND:COUNT[:SEED].
inline bool is_synthetic(std::string_view spec) { return spec.starts_with("synth:"); }

/// The key that two values of --scene, or two paths, share if they name the same scene: its path,
/// with symbolic links among its folders resolved, or the words of a procedural scene. A link in
/// place of the scene itself is a scene of its own, as its sidecar lies beside it.
std::string scene_key(const std::string& spec);

/// Makes the ids of scenes. An id depends only on the settings and the scene's path. Other files
/// never change an id, and an id never comes to mean another file. The path is used as given,
/// without resolving symbolic links, as for sidecars. Only the name of its last folder counts, so
/// ids survive another mount point. If two configured folders have the same name, their full paths
/// count.
class SceneIds {
 public:
  /// The values of --scene and --scene-folder.
  SceneIds(const std::vector<std::string>& scenes, const std::vector<std::string>& folders);

  /// `spec` is a value of --scene or a path in one of the folders. `name` is for people, in UTF-8.
  [[nodiscard]] std::string id_of(const std::string& spec, std::string_view name) const;

 private:
  std::set<std::filesystem::path> folders_;  // parent folders of scenes
  std::set<std::string> synthetic_;
};

}  // namespace catgs
