#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "render_core/scene/files/scene_size.h"

namespace catgs {

/// A scene in a folder, told by its headers.
struct FoundScene {
  std::filesystem::path path;
  std::string name;  // for people; UTF-8
  SceneSize size;
  /// Of the file, or of the newest one directly in its folder: another value is another scene.
  std::filesystem::file_time_type changed;
};

/// Looks for scenes in folders again and again, and reads the headers of new and changed ones only:
/// a folder may be a slow mount of an object store. Not thread-safe.
class SceneFolders {
 public:
  SceneFolders(std::vector<std::filesystem::path> folders, LoadOptions options)
      : folders_(std::move(folders)), options_(std::move(options)) {}

  /// What is there now, in order of the paths: scene files, SOG folders and training output folders
  /// directly in the folders; at most max_scenes, others are named in a warning. What cannot be
  /// read is left out, and said once. Throws InputError where a folder itself cannot be read.
  std::vector<FoundScene> scan();

  static constexpr std::size_t max_scenes = 10'000;

 private:
  struct Known {
    std::filesystem::file_time_type changed;
    bool good = false;
    FoundScene scene;
  };
  std::vector<std::filesystem::path> list() const;

  const std::vector<std::filesystem::path> folders_;
  const LoadOptions options_;
  std::map<std::filesystem::path, Known> known_;
  bool told_of_too_many_ = false;
};

}  // namespace catgs
