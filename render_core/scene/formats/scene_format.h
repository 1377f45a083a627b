#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/detail_tree.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/orbit_limits.h"
#include "render_core/scene/scene_origin.h"
#include "render_core/scene/usual_up.h"

namespace catgs {

/// The size of a scene, as announced by its headers.
struct SceneSize {
  std::uint64_t gaussians = 0;
  /// SH degree of the scene as loaded, 0…3; where only images tell it, the highest possible one.
  int sh_degree = 0;
  bool in_pages = false;  // a tree, of which any part may be in memory

  /// Size of the decoded scene; no core's copy is larger.
  [[nodiscard]] std::uint64_t bytes() const { return GaussianCloud::bytes(gaussians, sh_degree); }
};

/// The files of a scene.
struct SceneFiles {
  std::filesystem::path path{};  // of the scene's file; with an index, of its folder
  std::string index{};           // name of the file in the folder that lists the others

  /// The file that is read first.
  [[nodiscard]] std::filesystem::path first() const { return index.empty() ? path : path / index; }
  /// The files of a folder or an archive. An archive is unpacked in memory: all of it, or the entry
  /// `only`. Throws InputError.
  [[nodiscard]] std::shared_ptr<const FileSet> open(std::string_view only = {}) const;
};

/// The content of a scene's file, not sanitized.
struct DecodedScene {
  std::string format;  // as Scene::format
  GaussianCloud cloud;
  std::vector<std::string> notes{};  // as Scene::notes
  std::optional<OrbitLimits> orbit{};
  glm::dvec3 origin{0.0};  // that `cloud` is about, where the format is more exact than floats
  UsualUp usual_up = UsualUp::minus_y;
};

/// Reads a scene about 0, and again about its origin where that lies elsewhere. `read(origin)`
/// tells the DecodedScene.
template <class Read>
DecodedScene read_about_origin(const Read& read) {
  DecodedScene scene = read(glm::dvec3(0.0));
  const glm::dvec3 origin = find_origin(scene.cloud.mean);
  if (origin == glm::dvec3(0.0)) return scene;
  scene = {};  // makes room
  scene = read(origin);
  scene.origin = origin;
  return scene;
}

/// A scene that is read part by part, not sanitized.
struct DecodedParts {
  static constexpr std::uint64_t most_sampled = most_origin_positions;  // as robust_bounds() uses

  std::string format;       // as Scene::format
  std::uint64_t count = 0;  // of the parts
  std::function<GaussianCloud(std::uint64_t part, const LoadContext&)> read;
  GaussianCloud sample;            // an even one of at most `most_sampled`
  std::vector<std::string> notes;  // as Scene::notes
  glm::dvec3 origin{0.0};          // that the parts and the sample are about
  UsualUp usual_up = UsualUp::minus_y;
};

/// An even sample of a file's rows, of most_origin_places at most.
FileRows even_sample(std::uint64_t rows);

/// The parts of a file of which any rows can be read, about an origin. A part has `part_rows` of
/// the `rows` rows.
DecodedParts parts_of_rows(
    std::string format, std::uint64_t rows, std::uint64_t part_rows,
    const std::function<GaussianCloud(const FileRows&, const glm::dvec3& origin,
                                      const LoadContext&)>& read,
    const LoadContext& context, std::vector<std::string> notes = {});

/// What is to know of a format. Each format has one of these beside its reader, and
/// files/scene_formats.cpp lists them. A function that a format lacks is null. All functions throw
/// InputError.
struct SceneFormat {
  std::string_view name;                         // for people
  std::array<std::string_view, 2> extensions{};  // of its files; a written file has the first one
  std::string_view kinds{};                      // of its files, for people
  std::string_view index{};                      // a file that stands for its folder

  bool names_folder = false;  // a file with its extension stands for its folder, and other scene
                              // files there are parts of it
  bool may_be_mesh = false;   // its files often hold meshes, so that a scene beside them is meant
  bool json_is_data = false;  // any .json file in its folder may be part of the scene
  bool in_pages = false;      // renderers read what they need of it
  bool keeps_antialiased = false, keeps_surfels = false;  // a written file can tell these models
  bool keeps_origin = false;  // a written file has the coordinates of the file before it

  /// Whether a file is of this format. `extension`: of its name.
  bool (*is_mine)(const ByteSource& file, std::string_view extension) = nullptr;
  /// The names of the files beside `file` that hold its data.
  std::vector<std::string> (*files_beside)(const ByteSource& file) = nullptr;

  // A format without levels of detail has these.
  SceneSize (*size)(const SceneFiles& files) = nullptr;
  DecodedScene (*read)(const SceneFiles& files, const LoadContext& context) = nullptr;
  /// Nothing if this file cannot be read in parts. A scene has at most `most` Gaussians.
  std::optional<DecodedParts> (*read_parts)(const SceneFiles& files, std::uint64_t part_rows,
                                            std::uint64_t most,
                                            const LoadContext& context) = nullptr;

  // A format with levels of detail has these.
  OpenLevels (*open_levels)(const std::shared_ptr<const FileSet>& files, const std::string& index,
                            std::optional<int> level, std::optional<std::size_t> budget,
                            std::uint64_t most) = nullptr;
  /// The Gaussians of the chosen levels, if they can be counted without opening all of them.
  std::size_t (*count)(const SceneFiles& files, std::optional<int> level,
                       std::optional<std::size_t> budget) = nullptr;

  /// Writes a cloud that is about `origin`.
  void (*write)(const GaussianCloud& cloud, const glm::dvec3& origin, ThreadPool& pool,
                std::ostream& to) = nullptr;
  /// Says what a written file would not hold of the cloud, for people. Throws InputError where that
  /// is too much, as `write` does.
  std::vector<std::string> (*losses)(const GaussianCloud& cloud) = nullptr;
};

}  // namespace catgs
