#include "server/scenes/derived_files.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "render_core/base/error.h"
#include "render_core/scene/tree/tree_file.h"
#include "server/access/signed_token.h"
#include "server/base/log_event.h"
#include "server/base/replace_file.h"
#include "server/scenes/scene_ids.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

// A tree's file carries the time when its scene was last seen, about.
constexpr std::chrono::hours noted_every{1}, kept_for{7 * 24};
constexpr std::size_t path_digits = 8, content_digits = 16;
constexpr std::string_view tree_extension = ".tree";

bool is_derived_name(std::string_view name) {
  const auto ends_with_digits = [&](std::size_t digits) {
    if (name.size() <= digits || name[name.size() - digits - 1] != '-') return false;
    const bool hex = name.find_last_not_of("0123456789abcdef") == name.size() - digits - 1;
    name.remove_suffix(digits + 1);
    return hex;
  };
  name = name.substr(0, name.rfind('.'));
  return ends_with_digits(content_digits) && ends_with_digits(path_digits) && !name.empty();
}

bool is_tree_name(std::string_view name) {
  return name.ends_with(tree_extension) && is_derived_name(name);
}

/// The remains of a tree whose build was killed, besides NewFile: ScratchFile adds to its name.
/// Earlier versions added ".part", and named walkable areas by two digests alone.
bool is_remnant(std::string_view name) {
  constexpr std::size_t former_walk_digits = 16 + 1 + 32;
  const std::size_t stem = name.rfind('.');
  return is_tree_name(name.substr(0, stem)) ||
         (name.ends_with(".walk") && stem == former_walk_digits &&
          name.find_first_not_of("0123456789abcdef-") == stem);
}

std::string hex_digest(const std::string& text, std::size_t bytes) {
  const TokenDigest digest = digest_of(text);
  return fmt::format("{:02x}", fmt::join(std::span(digest).first(bytes), ""));
}

/// The part of a name that stands for its scene.
std::string_view scene_part(std::string_view name) { return name.substr(0, name.rfind('-')); }

/// Letters, digits and dashes. A name is for operators who look into the folder.
std::string plain(std::string_view name) {
  constexpr std::size_t most_chars = 40;
  std::string text(name.substr(0, most_chars));
  std::ranges::replace_if(
      text,
      [](char c) {
        return !((c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'));
      },
      '-');
  return text.empty() ? "scene" : text;
}

struct Content {
  std::uint64_t files = 0, bytes = 0;
  fs::file_time_type newest = fs::file_time_type::min();

  void add(const fs::path& file) {
    ++files;
    bytes += fs::file_size(file);
    newest = std::max(newest, fs::last_write_time(file));
  }
};

/// A sidecar may be saved at any time, and is read when the scene is loaded.
Content content_of(const SceneLocation& scene) {
  Content content;
  // A folder without an index of its format may hold other scenes.
  if (scene.files.index.empty() || scene.files.index != scene.format->index) {
    content.add(scene.files.first());
    for (const fs::path& other : files_beside(scene.files.first())) content.add(other);
    return content;
  }
  for (const auto& entry : fs::recursive_directory_iterator(scene.files.path))
    if (entry.is_regular_file() &&
        (scene.format->json_is_data || entry.path().extension() != ".json" ||
         is_scene_index(entry.path())))
      content.add(entry.path());
  return content;
}

}  // namespace

std::string derived_name(const SceneLocation& scene, const std::string& facts,
                         std::string_view extension) {
  const std::string spec = scene.given.string();
  return fmt::format("{}-{}-{}{}", plain(scene.name.empty() ? spec : scene.name),
                     hex_digest(scene_key(spec), path_digits / 2),
                     hex_digest(facts, content_digits / 2), extension);
}

std::string content_facts(const SceneLocation& scene) {
  const std::optional<SplatModel> model = model_in_sidecar(scene.hints);
  try {
    const Content content = content_of(scene);
    return fmt::format("{}\n{} {} {}\n{}", scene.files.path.string(), content.files, content.bytes,
                       content.newest.time_since_epoch().count(), model ? name_of(*model) : "");
  } catch (const fs::filesystem_error& error) {
    throw InputError(scene.given.string(), {}, "cannot be read: " + error.code().message());
  }
}

std::string tree_name(const SceneLocation& scene, const LoadOptions& levels) {
  constexpr int reading = 2;  // version of how scenes are read
  const std::string facts =
      fmt::format("{}\n{} {}\n{} {}", content_facts(scene), levels.lod.value_or(-1),
                  levels.gaussian_budget.value_or(0), TreeHeader::right_version, reading);
  return derived_name(scene, facts, tree_extension);
}

DerivedFiles::DerivedFiles(fs::path folder)
    : folder_(std::move(folder)), lock_(own_folder("--cache-dir", folder_, "lock")) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder_, error)) {
    const std::string name = entry.path().filename().string();
    const bool is_file = fs::is_regular_file(entry.symlink_status(error));
    if (is_file && is_tree_name(name))
      names_.insert(name);
    else if (is_file && is_remnant(name))
      fs::remove(entry.path(), error);
  }
}

void DerivedFiles::remove(const std::string& name) {
  std::error_code error;
  fs::remove(path_of(name), error);
  names_.erase(name);
}

void DerivedFiles::keep(const std::set<std::string>& names) {
  std::set<std::string_view> scenes;
  for (const std::string& name : names) scenes.insert(scene_part(name));
  std::vector<std::string> leaving;
  const auto now = fs::file_time_type::clock::now();
  for (const std::string& name : names_) {
    std::error_code error;
    const auto unseen_for = now - fs::last_write_time(path_of(name), error);
    if (names.contains(name)) {
      if (!error && unseen_for > noted_every) fs::last_write_time(path_of(name), now, error);
    } else if (scenes.contains(scene_part(name)) || error || unseen_for > kept_for) {
      leaving.push_back(name);
    }
  }
  for (const std::string& name : leaving) {
    log_info({.event = "tree_removed"}, "the tree {} is removed: no scene needs it", name);
    remove(name);
  }
}

std::optional<std::string> DerivedFiles::read(const std::string& name, std::size_t most_bytes,
                                              const Check& check) const {
  const fs::path path = path_of(name);
  std::error_code error;
  if (!fs::exists(path, error)) return std::nullopt;
  try {
    const std::vector<std::byte> bytes = FileSource(path).read_all(most_bytes);
    check(MemorySource(path.string(), bytes));
    fs::last_write_time(path, fs::file_time_type::clock::now(), error);
    return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  } catch (const InputError& failure) {
    const bool removed = fs::remove(path, error);
    log_warning({.event = "cached_file_unusable"}, "{}: {}", removed ? "removed" : "not used",
                failure.what());
    return std::nullopt;
  }
}

void DerivedFiles::write(const std::string& name, const std::string& bytes,
                         std::size_t most) const {
  const fs::path extension = fs::path(name).extension();
  std::vector<std::pair<fs::file_time_type, fs::path>> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder_, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code gone;
    const std::string other = entry->path().filename().string();
    if (is_derived_name(other) && other != name && entry->path().extension() == extension)
      files.emplace_back(entry->last_write_time(gone), entry->path());
  }
  std::ranges::sort(files, std::greater<>());
  std::size_t kept = 1, of_scene = 1;  // with the new one
  for (const auto& [used, file] : files) {
    const bool of_this_scene = scene_part(file.filename().string()) == scene_part(name);
    const bool too_many = of_this_scene && ++of_scene > most_small_files_of_scene;
    if (too_many || ++kept > most) fs::remove(file, error);
  }
  try {
    overwrite_file(path_of(name), bytes, "make room in --cache-dir");
  } catch (const InputError& failure) {  // a full disk costs the next start some time
    log_warning({.event = "not_cached"}, "{}", failure.what());
  }
}

}  // namespace catgs
