#include "render_core/scene/files/locate_scene.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/gltf.h"
#include "render_core/scene/formats/lcc2.h"

namespace catgs {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view iteration_prefix = "iteration_";

/// Files that stand for their folders. Where a folder has several, the first one counts.
constexpr std::array<std::pair<std::string_view, SceneLocation::Kind>, 3> indices = {
    {{"lod-meta.json", SceneLocation::Kind::streamed_sog_folder},
     {"tileset.json", SceneLocation::Kind::tiles_folder},
     {"meta.json", SceneLocation::Kind::sog_folder}}};

std::optional<std::uint64_t> iteration_number(const fs::path& folder) {
  const std::string name = folder.filename().string();
  if (!name.starts_with(iteration_prefix)) return std::nullopt;
  std::uint64_t number = 0;
  const char* first = name.data() + iteration_prefix.size();
  const auto [end, error] = std::from_chars(first, name.data() + name.size(), number);
  if (error != std::errc{} || end != name.data() + name.size()) return std::nullopt;
  return number;
}

/// `…/point_cloud/iteration_N/point_cloud.ply` of the highest N that has one.
std::optional<fs::path> newest_iteration(const fs::path& training) {
  std::error_code error;
  std::optional<std::pair<std::uint64_t, fs::path>> newest;
  for (const auto& entry : fs::directory_iterator(training / "point_cloud", error)) {
    const auto number = iteration_number(entry.path());
    const fs::path ply = entry.path() / "point_cloud.ply";
    if (number && (!newest || *number > newest->first) && fs::is_regular_file(ply, error))
      newest = {*number, ply};
  }
  if (!newest) return std::nullopt;
  return newest->second;
}

/// The training output folder that a point cloud lies in, if any.
std::optional<fs::path> training_of(const fs::path& file) {
  const fs::path iteration = file.parent_path(), clouds = iteration.parent_path();
  if (!iteration_number(iteration) || clouds.filename() != "point_cloud") return std::nullopt;
  return clouds.parent_path();
}

/// The only scene file directly in the folder.
fs::path single_scene_file(const fs::path& folder) {
  std::vector<std::string> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (is_scene_name(entry.path()) && entry.is_regular_file())
      found.push_back(entry.path().filename().string());
  }
  if (found.empty()) throw InputError(folder.string(), "", "holds no scene", supported_scenes);
  // The .sog or .spz files beside an .lcc2 are its parts.
  const auto is_index = [](const std::string& name) { return name.ends_with(".lcc2"); };
  if (std::ranges::any_of(found, is_index)) std::erase_if(found, std::not_fn(is_index));
  // A .glb or .gltf beside a scene is a mesh, most likely.
  const auto may_be_mesh = [](const std::string& name) {
    return name.ends_with(".glb") || name.ends_with(".gltf");
  };
  if (!std::ranges::all_of(found, may_be_mesh)) std::erase_if(found, may_be_mesh);
  std::sort(found.begin(), found.end());
  if (found.size() > 1)
    throw InputError(
        folder.string(), "",
        fmt::format("holds {} scenes: {}{}", found.size(),
                    fmt::join(found.begin(),
                              found.begin() + std::min<std::ptrdiff_t>(4, std::ssize(found)), ", "),
                    found.size() > 4 ? ", …" : ""),
        "name one of them");
  return folder / found.front();
}

SceneLocation at_folder(SceneLocation::Kind kind, const fs::path& folder) {
  SceneLocation location;
  location.kind = kind;
  location.path = folder;
  location.name = folder.filename().string();
  location.hints.sidecar = folder.parent_path() / (location.name + ".json");
  return location;
}

/// Exporters call the file of a scene meta.lcc2, or as the scene is called.
SceneLocation at_lcc2(const fs::path& file) {
  std::error_code error;
  const fs::path folder = fs::absolute(file, error).lexically_normal().parent_path();
  SceneLocation location = at_folder(SceneLocation::Kind::lcc2, folder);
  location.index = file.filename().string();
  if (file.stem() == "meta") return location;
  location.name = file.stem().string();
  location.hints.sidecar = sidecar_of(file);
  return location;
}

SceneLocation at_file(const fs::path& file) {
  if (file.extension() == ".lcc2") return at_lcc2(file);
  SceneLocation location;
  if (file.extension() == ".ssog") location.kind = SceneLocation::Kind::streamed_sog_archive;
  location.path = file;
  const auto training = training_of(file);
  const fs::path folder = training.value_or(file.parent_path());
  location.name = training ? training->filename().string() : file.stem().string();
  location.hints.sidecar = sidecar_of(file);
  location.hints.cameras = folder / "cameras.json";
  location.hints.transforms = folder / "transforms.json";
  return location;
}

}  // namespace

bool is_scene_name(const fs::path& path) {
  constexpr std::array extensions = {".ply",  ".splat", ".ksplat", ".spz",  ".sog",
                                     ".ssog", ".glb",   ".gltf",   ".lcc2", ".tree"};
  return std::find(extensions.begin(), extensions.end(), path.extension().string()) !=
         extensions.end();
}

bool is_scene_index(const fs::path& file) {
  return std::ranges::any_of(indices,
                             [&](const auto& index) { return file.filename() == index.first; });
}

bool has_scene_index(const fs::path& folder) {
  std::error_code error;
  if (std::ranges::any_of(
          indices, [&](const auto& index) { return fs::exists(folder / index.first, error); }))
    return true;
  fs::directory_iterator entries(folder, error);
  return std::any_of(begin(entries), end(entries), [](const fs::directory_entry& entry) {
    return entry.path().extension() == ".lcc2";
  });
}

SceneLocation locate_scene(const fs::path& given) {
  std::error_code error;
  fs::path path = fs::absolute(given, error).lexically_normal();  // so that "." has a name
  if (!path.has_filename()) path = path.parent_path();
  if (!fs::exists(path, error))
    throw InputError(given.string(), "", "does not exist",
                     given.string().starts_with("synth:")
                         ? "catgs-render synth city OUT.ply makes such a scene"
                         : "");
  if (is_scene_index(path)) path = path.parent_path();
  if (!fs::is_directory(path, error)) return at_file(given);

  for (const auto& [name, kind] : indices)
    if (fs::exists(path / name, error)) return at_folder(kind, path);
  if (const auto ply = newest_iteration(path)) {
    SceneLocation location = at_file(*ply);
    location.hints.sidecar = path.parent_path() / (location.name + ".json");
    return location;
  }
  return at_file(single_scene_file(path));
}

std::vector<fs::path> files_beside(const fs::path& scene) {
  std::vector<fs::path> files;
  const bool is_gltf = scene.extension() == ".gltf", is_lcc2 = scene.extension() == ".lcc2";
  if (!is_gltf && !is_lcc2) return files;
  try {
    const FileSource file(scene);
    for (const std::string& name : is_gltf ? gltf_buffer_files(file) : lcc2_files(file))
      files.push_back(scene.parent_path() / name);
  } catch (const InputError&) {
  }
  return files;
}

}  // namespace catgs
