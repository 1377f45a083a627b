#include "render_core/scene/files/locate_scene.h"

#include <algorithm>
#include <charconv>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/files/scene_formats.h"

namespace catgs {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view iteration_prefix = "iteration_";

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

const SceneFormat* format_named(const fs::path& file) {
  return format_with(file.extension().string());
}

/// The only scene file directly in the folder.
fs::path single_scene_file(const fs::path& folder) {
  std::vector<std::string> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (is_scene_name(entry.path()) && entry.is_regular_file())
      found.push_back(entry.path().filename().string());
  }
  if (found.empty()) throw InputError(folder.string(), "", "holds no scene", supported_scenes());
  const auto is_index = [](const std::string& name) { return format_named(name)->names_folder; };
  if (std::ranges::any_of(found, is_index)) std::erase_if(found, std::not_fn(is_index));
  const auto may_be_mesh = [](const std::string& name) { return format_named(name)->may_be_mesh; };
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

SceneLocation at_folder(const SceneFormat& format, const fs::path& folder, std::string index) {
  SceneLocation location;
  location.format = &format;
  location.files = {folder, std::move(index)};
  location.name = folder.filename().string();
  location.hints.sidecar = folder.parent_path() / (location.name + ".json");
  return location;
}

/// Exporters call such a file "meta", as in meta.lcc2, or as the scene is called.
SceneLocation at_folder_of(const SceneFormat& format, const fs::path& file) {
  std::error_code error;
  const fs::path folder = fs::absolute(file, error).lexically_normal().parent_path();
  SceneLocation location = at_folder(format, folder, file.filename().string());
  if (file.stem() == "meta") return location;
  location.name = file.stem().string();
  location.hints.sidecar = sidecar_of(file);
  return location;
}

SceneLocation at_file(const fs::path& file) {
  const SceneFormat& format = format_of(file);
  if (format.names_folder) return at_folder_of(format, file);
  SceneLocation location;
  location.format = &format;
  location.files.path = file;
  const auto training = training_of(file);
  const fs::path folder = training.value_or(file.parent_path());
  location.name = training ? training->filename().string() : file.stem().string();
  location.hints.sidecar = sidecar_of(file);
  location.hints.cameras = folder / "cameras.json";
  location.hints.transforms = folder / "transforms.json";
  location.hints.test_views = folder / "transforms_test.json";
  return location;
}

/// The format whose index a folder has; null: none.
const SceneFormat* format_of_folder(const fs::path& folder) {
  std::error_code error;
  const auto found = std::ranges::find_if(scene_formats(), [&](const SceneFormat* format) {
    return !format->index.empty() && fs::exists(folder / format->index, error);
  });
  return found == scene_formats().end() ? nullptr : *found;
}

SceneLocation locate(const fs::path& given) {
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

  if (const SceneFormat* format = format_of_folder(path))
    return at_folder(*format, path, std::string(format->index));
  if (const auto ply = newest_iteration(path)) {
    SceneLocation location = at_file(*ply);
    location.hints.sidecar = path.parent_path() / (location.name + ".json");
    return location;
  }
  return at_file(single_scene_file(path));
}

}  // namespace

bool is_scene_name(const fs::path& path) { return format_named(path) != nullptr; }

bool is_scene_index(const fs::path& file) {
  return std::ranges::any_of(scene_formats(), [&](const SceneFormat* format) {
    return !format->index.empty() && file.filename() == format->index;
  });
}

bool has_scene_index(const fs::path& folder) {
  if (format_of_folder(folder) != nullptr) return true;
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  return std::any_of(begin(entries), end(entries), [](const fs::directory_entry& entry) {
    const SceneFormat* format = format_named(entry.path());
    return format != nullptr && format->names_folder;
  });
}

SceneLocation locate_scene(const fs::path& given) {
  SceneLocation location = locate(given);
  location.given = given;
  return location;
}

std::vector<fs::path> files_beside(const fs::path& scene) {
  std::vector<fs::path> files;
  const SceneFormat* format = format_named(scene);
  if (format == nullptr || !format->files_beside) return files;
  try {
    for (const std::string& name : format->files_beside(FileSource(scene)))
      files.push_back(scene.parent_path() / name);
  } catch (const InputError&) {
  }
  return files;
}

}  // namespace catgs
