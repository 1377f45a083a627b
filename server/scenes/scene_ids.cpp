#include "server/scenes/scene_ids.h"

#include <algorithm>
#include <span>
#include <system_error>

#include "render_core/scene/files/locate_scene.h"
#include "server/access/signed_token.h"
#include "server/base/log_event.h"
#include "server/base/scene_id.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

fs::path whole_path(const fs::path& given) {
  const fs::path path = fs::absolute(given).lexically_normal();
  return path.has_filename() ? path : path.parent_path();
}

/// The name of a file or folder. A folder may be given by the file in it.
fs::path scene_path(const fs::path& given) {
  const fs::path path = whole_path(given);
  return is_scene_index(path) ? path.parent_path() : path;
}

std::string with_digest(std::string_view name, std::string_view path) {
  const TokenDigest digest = digest_of(path);
  return scene_id_of(name, std::span(digest).first<4>());
}

}  // namespace

std::string scene_key(const std::string& spec) {
  if (is_synthetic(spec)) return spec;
  const fs::path path = scene_path(spec);
  std::error_code error;
  const fs::path folder = fs::canonical(path.parent_path(), error);
  return ((error ? path.parent_path() : folder) / path.filename()).string();
}

SceneIds::SceneIds(const std::vector<std::string>& scenes,
                   const std::vector<std::string>& folders) {
  for (const std::string& given : folders) {
    const fs::path folder = whole_path(given);
    const auto twin = std::ranges::find(folders_, folder.filename(), &fs::path::filename);
    if (twin != folders_.end() && *twin != folder)
      log_warning(
          {.event = "scene_folders_alike"},
          "--scene-folder {} and {} have the same name: the ids of their scenes are made of "
          "whole paths, and differ from those that each folder would give alone",
          twin->string(), folder.string());
    folders_.insert(folder);
  }
  for (const std::string& spec : scenes) {
    if (is_synthetic(spec))
      synthetic_.insert(spec);
    else
      folders_.insert(scene_path(spec).parent_path());
  }
}

std::string SceneIds::id_of(const std::string& spec, std::string_view name) const {
  if (is_synthetic(spec)) {
    // It has no file. Its name is enough unless several scenes are of its kind.
    const std::string kind = spec.substr(0, spec.find(':', spec.find(':') + 1) + 1);
    const bool alone = std::ranges::none_of(synthetic_, [&](const std::string& other) {
      return other != spec && other.starts_with(kind);
    });
    return alone ? scene_name_of(name) : with_digest(name, spec);
  }
  const fs::path path = scene_path(spec);
  const fs::path folder = path.parent_path();
  const bool alike = std::ranges::any_of(folders_, [&](const fs::path& other) {
    return other != folder && other.filename() == folder.filename();
  });
  return with_digest(name, ((alike ? folder : folder.filename()) / path.filename()).string());
}

}  // namespace catgs
