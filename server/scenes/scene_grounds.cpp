#include "server/scenes/scene_grounds.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include <boost/asio/post.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/walk/walk_file.h"
#include "server/base/clock.h"
#include "server/base/log_event.h"
#include "server/base/prompt_thread.h"
#include "server/base/replace_file.h"
#include "server/net/http.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

/// Ends a search from within.
struct Cancelled {};

/// The bytes of a file that reads well; an empty one says that there is no ground. Throws
/// InputError.
std::string read_whole(const fs::path& path) {
  const FileSource file(path);
  const std::vector<std::byte> bytes = file.read_all(SceneGrounds::max_file_bytes);
  if (!bytes.empty()) walk::read_walk_file(MemorySource(path.string(), bytes));
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

SceneGrounds::~SceneGrounds() {
  cancelled_ = true;
  finder_.join();
}

void SceneGrounds::find(const std::string& scene_id, GroundSource source,
                        std::function<void(std::shared_ptr<const SceneGround>)> found) {
  busy_ = true;
  boost::asio::post(
      finder_, [this, scene_id, source = std::move(source), found = std::move(found)] {
        run_in_background();
        std::shared_ptr<SceneGround> ground;
        try {
          std::string bytes = find_now(scene_id, source);
          ground = std::make_shared<SceneGround>();
          if (!bytes.empty()) {
            ground->etag = etag_of(bytes);
            ground->file = std::make_shared<const std::string>(std::move(bytes));
          }
        } catch (const Cancelled&) {
          return;
        } catch (const std::exception& error) {
          log_warning({.event = "ground_failed", .scene = scene_id},
                      "scene {}: its ground is not found: {}", scene_id, error.what());
        }
        boost::asio::post(io_, [this, ground, found] {
          busy_ = false;
          found(ground);
        });
      });
}

std::string SceneGrounds::find_now(const std::string& scene_id, const GroundSource& source) const {
  std::error_code error;
  if (!source.beside.empty() && fs::exists(source.beside, error)) {
    try {
      std::string bytes = read_whole(source.beside);
      if (bytes.empty()) throw InputError(source.beside.string(), "", "is empty");
      log_info({.event = "ground_found", .scene = scene_id}, "scene {}: people walk by {}",
               scene_id, source.beside.string());
      return bytes;
    } catch (const InputError& failure) {
      log_warning({.event = "ground_unusable", .scene = scene_id},
                  "scene {}: its ground is computed, because {}", scene_id, failure.what());
    }
  }
  return kept_or_computed(scene_id, source);
}

std::string SceneGrounds::kept_or_computed(const std::string& scene_id,
                                           const GroundSource& source) const {
  std::error_code error;
  const fs::path kept = folder_.empty() ? fs::path() : folder_ / ground_name(source);
  if (!kept.empty() && fs::exists(kept, error)) {
    try {
      std::string bytes = read_whole(kept);
      fs::last_write_time(kept, fs::file_time_type::clock::now(), error);
      return bytes;
    } catch (const InputError& failure) {
      log_warning({.event = "ground_unusable", .scene = scene_id}, "scene {}: {}", scene_id,
                  failure.what());
      fs::remove(kept, error);
    }
  }
  const TimePoint begin = Clock::now();
  std::string bytes;
  try {
    bytes = compute_ground(source, threads_, [this] {
      if (cancelled_) throw Cancelled();
    });
    if (bytes.size() > max_file_bytes)
      throw NoGround(InputError(source.scene.given.string(), "", "has too much ground for pages"));
    log_info({.event = "ground_found", .scene = scene_id},
             "scene {}: its ground was found in {:.1f} s and takes {} kB", scene_id,
             std::chrono::duration<double>(Clock::now() - begin).count(), bytes.size() / 1000);
  } catch (const NoGround& failure) {
    log_info({.event = "ground_missing", .scene = scene_id}, "scene {}: nobody can walk in it: {}",
             scene_id, failure.what());
  }
  if (!kept.empty()) keep(kept, bytes);
  return bytes;
}

/// The files that were used last stay, but a few of one scene.
void SceneGrounds::keep(const fs::path& path, const std::string& bytes) const {
  std::vector<std::pair<fs::file_time_type, fs::path>> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder_, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code gone;
    if (entry->path().extension() == ".walk")
      files.emplace_back(entry->last_write_time(gone), entry->path());
  }
  std::ranges::sort(files, std::greater<>());
  const std::string scene = path.filename().string().substr(0, ground_scene_digits);
  std::size_t kept = 1, of_scene = 1;  // with the new one
  for (const auto& [used, file] : files) {
    const bool too_many_of_scene =
        file.filename().string().starts_with(scene) && ++of_scene > max_kept_of_scene;
    if (too_many_of_scene || ++kept > max_kept) fs::remove(file, error);
  }
  try {
    overwrite_file(path, bytes, "make room in --cache-dir");
  } catch (const InputError& failure) {  // a full disk costs the next start some time
    log_warning({.event = "ground_not_kept"}, "{}", failure.what());
  }
}

}  // namespace catgs
