#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/formats/byte_source.h"
#include "server/base/file_lock.h"

namespace catgs {

/// The name of a file that is computed from a scene: "hall-3f0c91d2-9b1deb4d3b7d4bad.walk". The
/// first digest is of the scene's path, the second one of `facts`.
std::string derived_name(const SceneLocation& scene, const std::string& facts,
                         std::string_view extension);
/// The facts that change with the scene's files (path, number, sizes, newest time) and its model.
/// Nothing else of sidecars counts. Reads the names, sizes and times of the files. Throws
/// InputError.
std::string content_facts(const SceneLocation& scene);
/// That of a scene's tree. It changes with content_facts(), with the levels that are chosen of the
/// scene, and with the format of trees. Throws InputError.
std::string tree_name(const SceneLocation& scene, const LoadOptions& levels);

/// The files in --cache-dir that the server has computed from scenes: trees, and small files:
/// walkable areas, posters, first views, and whether a tree is drawn. Files of other names are left
/// alone. Not thread-safe, but for the small files.
class DerivedFiles {
 public:
  static constexpr std::size_t most_walkable_areas = 256;
  static constexpr std::size_t most_posters = 10'000;          // about 1 GB
  static constexpr std::size_t most_views = 10'000;            // about 40 MB, a block each
  static constexpr std::size_t most_choices = 10'000;          // likewise
  static constexpr std::size_t most_small_files_of_scene = 4;  // as authors save it again and again

  /// Makes the folder if needed, and removes what builds that were killed and earlier versions have
  /// left. The folder belongs to this process as long as this object exists. Throws InputError that
  /// names --cache-dir if the folder cannot be written, or belongs to another process.
  explicit DerivedFiles(std::filesystem::path folder);

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

  /// Throws InputError unless the bytes of a small file read well.
  using Check = std::function<void(const ByteSource&)>;
  /// The bytes of a small file, which counts as used now; nothing: it is not there, or it was
  /// damaged and is removed. Any thread.
  [[nodiscard]] std::optional<std::string> read(const std::string& name, std::size_t most_bytes,
                                                const Check& check) const;
  /// Writes a small file. The `most` of its kind that were used last stay, but a few of one scene.
  /// Any thread.
  void write(const std::string& name, const std::string& bytes, std::size_t most) const;

 private:
  const std::filesystem::path folder_;
  const FileLock lock_;
  std::set<std::string> names_;
};

}  // namespace catgs
