// catgs-render convert: reads a scene, edits it, and writes it in another format.
#include <cmath>
#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/base/printable.h"
#include "render_core/scene/edit/edit_scene.h"
#include "render_core/scene/files/hints.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/files/media_name.h"
#include "render_core/scene/files/save_scene.h"
#include "render_core/scene/files/scene_formats.h"
#include "render_core/scene/files/scene_parts.h"
#include "render_core/scene/files/tour_places.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/scene.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/progress.h"
#include "render_core/tools/render/edit_options.h"
#include "render_core/tools/render/tree_output.h"
#include "render_core/tools/scene_options.h"

namespace catgs {
namespace {

struct ConvertOptions {
  SceneOptions in;
  std::string out;
  EditOptions edit;
  int threads = 0;
  TreeOptions tree;
};

/// A conversion that has been checked.
struct Conversion {
  const ConvertOptions& options;
  SceneEdit edit;
  SceneLocation in;
};

/// Copies the files that tours can show. Those that are there stay. Throws InputError.
void copy_media(const std::filesystem::path& from_sidecar,
                const std::filesystem::path& to_sidecar) {
  namespace fs = std::filesystem;
  fs::path from = from_sidecar, to = to_sidecar;
  from.replace_extension(media_folder_extension);
  to.replace_extension(media_folder_extension);
  std::error_code error;
  if (!fs::is_directory(from, error)) return;
  fs::create_directories(to, error);
  std::size_t copied = 0, there = 0;
  if (!error)
    for (fs::directory_iterator it(from, error), end; !error && it != end; it.increment(error)) {
      std::error_code unknown;  // such a file is none that is copied
      const fs::path name = it->path().filename();
      if (!is_media_name(name.string()) || it->is_symlink(unknown) || !it->is_regular_file(unknown))
        continue;
      ++(fs::copy_file(*it, to / name, fs::copy_options::skip_existing, error) ? copied : there);
      if (error) break;
    }
  if (error)
    throw InputError(to.string(), "", "cannot take the media of the tours: " + error.message(),
                     "copy " + from.string() + " by hand");
  fmt::print("{}: copied {} media files from {}, {} were there already\n", to.string(), copied,
             from.string(), there);
}

/// Whether the output cannot have the coordinates of the input.
bool loses_origin(const Conversion& conversion, const EditAboutOrigin& done) {
  return done.origin != glm::dvec3(0.0) && !keeps_origin(conversion.options.out);
}

/// Whether places have other coordinates in the output than in the input.
bool moves(const Conversion& conversion, const EditAboutOrigin& done) {
  return conversion.edit.placement.moves() || loses_origin(conversion, done);
}

/// Whether the output's sidecar would tell the view of the input, too.
bool shares_sidecar(const Conversion& conversion) {
  std::error_code error;
  const std::filesystem::path to = sidecar_of(conversion.options.out);
  return std::filesystem::weakly_canonical(to, error) ==
         std::filesystem::weakly_canonical(conversion.in.hints.sidecar, error);
}

/// The hints of the output. They count from the 0 of the file that is written.
SceneHints hints_of_output(const SceneHints& hints, const Conversion& conversion,
                           const EditAboutOrigin& done) {
  const Placement& moved = done.edit.placement;
  SceneHints written = moved.moves() ? placed(hints, moved) : hints;
  written.origin = keeps_origin(conversion.options.out) ? done.origin : glm::dvec3(0.0);
  return written;
}

/// Whether a sidecar that is there leaves the hints of the output as they are.
bool tells_hints(const std::filesystem::path& sidecar, const SceneHints& moved) {
  SceneHints there = moved;
  try {
    use_sidecar(read_sidecar(FileSource(sidecar), moved.origin), sidecar.string(), there);
  } catch (const InputError&) {
    return false;  // whatever it means to tell
  }
  const float tolerance = 1e-5f * (1.0f + glm::distance(moved.limits.min, moved.limits.max));
  const auto same = [&](const glm::vec3& a, const glm::vec3& b) {
    return glm::distance(a, b) <= tolerance;
  };
  const glm::quat &was = moved.start_pose.orientation, &is = there.start_pose.orientation;
  return same(moved.start_pose.position, there.start_pose.position) &&
         std::abs(glm::dot(was, is)) > 1.0f - 1e-5f && same(moved.focus, there.focus) &&
         same(moved.limits.min, there.limits.min) && same(moved.limits.max, there.limits.max) &&
         glm::distance(moved.up, there.up) < 1e-4f &&
         std::abs(moved.near_z - there.near_z) <= tolerance;
}

/// Whether the sidecar that is there stays: an author has changed it, or the input has it, too.
bool keeps_sidecar(const Conversion& conversion) {
  const auto sidecar = sidecar_of(conversion.options.out);
  std::error_code error;
  return std::filesystem::exists(sidecar, error) &&
         (shares_sidecar(conversion) || !is_unedited(sidecar));
}

/// Another scene than the output that uses the sidecar; empty: none.
std::filesystem::path other_scene_of(const std::filesystem::path& sidecar,
                                     const std::filesystem::path& out) {
  std::error_code error;
  const auto folder = sidecar.has_parent_path() ? sidecar.parent_path() : ".";
  for (std::filesystem::directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    std::error_code unknown;
    const auto& path = it->path();
    const bool is_scene = path.filename().string().starts_with(sidecar.stem().string()) &&
                          (it->is_regular_file(unknown) || it->is_directory(unknown));
    if (!is_scene || std::filesystem::equivalent(path, out, unknown) ||
        std::filesystem::equivalent(path, sidecar, unknown))
      continue;
    try {
      if (std::filesystem::equivalent(locate_scene(path).hints.sidecar, sidecar, unknown))
        return path;
    } catch (const InputError&) {  // it is no scene
    }
  }
  return {};
}

/// Refuses outputs whose view a sidecar that is there would tell wrongly, and those whose view
/// would be wrong for another scene that has the same sidecar.
void check_sidecar_fits(const SceneHints& hints, const Conversion& conversion,
                        const EditAboutOrigin& done) {
  const auto sidecar = sidecar_of(conversion.options.out);
  if (std::error_code error; !std::filesystem::exists(sidecar, error)) return;
  const bool stays = keeps_sidecar(conversion);
  if (stays && !moves(conversion, done)) return;
  const auto other =
      stays ? std::filesystem::path() : other_scene_of(sidecar, conversion.options.out);
  if ((!stays && other.empty()) || tells_hints(sidecar, hints_of_output(hints, conversion, done)))
    return;
  if (stays)
    throw InputError(sidecar.string(), "", "is there, and would not fit the moved scene",
                     "give the output another name, or move the file away");
  throw InputError(sidecar.string(), "",
                   fmt::format("tells another view, that of {}", other.string()),
                   "give the output another name or folder, or move the file away");
}

/// The output begins where the input does. Its own estimate would differ a little, so that pictures
/// of both could not be compared. A view that has moved is not the input's.
void write_hints_beside(const SceneHints& hints, const Conversion& conversion,
                        const EditAboutOrigin& done) {
  const auto sidecar = sidecar_of(conversion.options.out);
  const SceneHints written = hints_of_output(hints, conversion, done);
  const auto leave = [&](std::string_view why) {
    fmt::print(stderr, "note: {} {}\n", printable(sidecar.string()), why);
  };
  if (keeps_sidecar(conversion))
    return leave(shares_sidecar(conversion) ? "stays as it is: both scenes use it"
                 : tells_hints(sidecar, written)
                     ? "exists and was left as it is"
                     : "exists and was left as it is, since an author changed "
                       "it. What it tells of the view may be of another scene: "
                       "look, or move it away and convert again");
  if (moves(conversion, done) && shares_sidecar(conversion))
    return leave("was not written, since it would be the input's, too");
  nlohmann::ordered_json page_fields = page_fields_in_sidecar(conversion.in.hints);
  Placement placement = conversion.edit.placement;
  if (!keeps_origin(conversion.options.out)) placement.offset -= done.origin;
  if (placement.moves()) place_tours(page_fields, placement, written);
  write_sidecar(written, sidecar, &page_fields);
  fmt::print("{}: first view, {}{}\n", sidecar.string(), hints.source == "estimated" ? "" : "from ",
             hints.source);
  if (conversion.edit.crop)
    fmt::print(stderr, "note: its first view and limits are still those of the whole scene\n");
  if (page_fields.contains("tours")) copy_media(conversion.in.hints.sidecar, sidecar);
}

/// Before the scene is loaded, which may take minutes.
Conversion check(const ConvertOptions& options) {
  const Conversion conversion{options, edit_of(options.edit), locate_scene(options.in.path)};
  if (!is_tree_name(options.out)) check_can_be_saved(options.out);
  std::error_code error;
  for (const std::filesystem::path& path : {conversion.in.given, conversion.in.files.path})
    if (std::filesystem::equivalent(path, options.out, error))
      throw InputError(options.out, "", "is the scene that is read",
                       "give the output another name");
  return conversion;
}

void print_notes(const std::vector<std::string>& notes) {
  for (const std::string& note : notes) fmt::print(stderr, "note: {}\n", printable(note));
}

void check_not_empty(std::size_t left) {
  if (left == 0)
    throw InputError("--crop", "", "no Gaussian's centre lies in the box",
                     "it is in axes and units of the output; see catgs-render info");
}

/// The parts of a scene, each of them edited. Counts what the last reading has cropped.
SceneParts edited(const SceneParts& parts, const EditAboutOrigin& about,
                  const std::shared_ptr<ThreadPool>& pool, EditCounts& counts) {
  SceneParts result = parts;
  result.origin = about.origin;
  result.each = [each = parts.each, &edit = about.edit, pool, &counts](const auto& take) {
    std::size_t left = 0;
    counts = {};
    const std::uint64_t dropped = each([&](GaussianCloud part) {
      counts.cropped += edit_cloud(part, edit, *pool, LoadContext(*pool)).cropped;
      left += part.size();
      if (!part.empty()) take(part);
    });
    check_not_empty(left);
    return dropped;
  };
  return result;
}

/// Writes a tree without holding the scene, if its format and the edit allow that.
bool convert_in_parts(const Conversion& conversion, bool quiet) {
  const ConvertOptions& options = conversion.options;
  if (!is_tree_name(options.out) || !conversion.edit.works_on_parts()) return false;
  if (options.in.lod || options.in.budget) return false;
  const auto pool = std::make_shared<ThreadPool>(options.threads);
  LoadOptions load;
  load.up = up_of(options.in);
  load.model = model_of(options.in);
  const auto scene = scene_in_parts(conversion.in, load, pool);
  if (!scene) return false;
  EditCounts counts;
  const EditAboutOrigin about = about_origin(conversion.edit, scene->hints.origin);
  check_sidecar_fits(scene->hints, conversion, about);
  write_tree(edited(scene->parts, about, pool, counts), options.tree, options.out, *pool, quiet);
  print_counts(counts);
  print_notes(scene->notes);
  write_hints_beside(scene->hints, conversion, about);
  return true;
}

void save(const Scene& scene, const glm::dvec3& origin, const ConvertOptions& options, bool quiet) {
  if (!is_tree_name(options.out))
    return save_scene(scene.cloud, options.out, options.threads, origin);
  ThreadPool pool(options.threads);
  const SceneParts whole{[&](const auto& take) {
                           take(scene.cloud);
                           return std::uint64_t{scene.report.dropped};
                         },
                         scene.format, true, origin};
  write_tree(whole, options.tree, options.out, pool, quiet);
}

EditCounts edit_whole(GaussianCloud& cloud, const SceneEdit& edit, int threads, bool quiet) {
  ThreadPool pool(threads);
  Progress progress("editing", quiet);
  const LoadContext context(pool, [&](double fraction) { progress.update(fraction); });
  const EditCounts counts = edit_cloud(cloud, edit, pool, context);
  check_not_empty(cloud.size());
  return counts;
}

void convert(const ConvertOptions& options, bool quiet) {
  const Conversion conversion = check(options);
  if (convert_in_parts(conversion, quiet)) return;
  Scene scene = load_scene(conversion.in, options.in, options.threads, quiet);
  const EditAboutOrigin about = about_origin(conversion.edit, scene.hints.origin);
  check_sidecar_fits(scene.hints, conversion, about);
  const EditCounts counts = edit_whole(scene.cloud, about.edit, options.threads, quiet);
  print_notes(losses_of(scene.cloud, options.out));
  save(scene, about.origin, options, quiet);
  fmt::print("{}: {} of {} Gaussians, {:.1f} MB, from {}\n", options.out, scene.cloud.size(),
             scene.report.read, 1e-6 * static_cast<double>(std::filesystem::file_size(options.out)),
             scene.format);
  if (scene.report.dropped > 0)
    fmt::print("{} could not be drawn and were dropped (catgs-render info says why)\n",
               scene.report.dropped);
  print_counts(counts);
  print_notes(scene.notes);
  if (!keeps_model(options.out, scene.cloud.model))
    fmt::print(stderr, "note: {} cannot tell its model; write \"model\": \"{}\" into {}\n",
               options.out, name_of(scene.cloud.model), sidecar_of(options.out).string());
  if (loses_origin(conversion, about))
    fmt::print(stderr, "note: {} is about its origin: add [{}, {}, {}] to its coordinates\n",
               options.out, about.origin.x, about.origin.y, about.origin.z);
  write_hints_beside(scene.hints, conversion, about);
}

}  // namespace

void add_convert_command(CLI::App& app) {
  auto options = std::make_shared<ConvertOptions>();
  const std::string extensions = written_extensions();
  CLI::App* command = app.add_subcommand("convert", "Converts a scene to " + extensions);
  add_scene_options(*command, options->in, "in");
  command->add_option("out", options->out, "File to write: " + extensions)->required();
  command->add_option("--threads", options->threads, "Number of threads; 0: one per processor")
      ->capture_default_str();
  add_tree_options(*command, options->tree);
  add_edit_options(*command, options->edit);
  command->callback([options, command] { convert(*options, is_quiet(*command)); });
}

}  // namespace catgs
