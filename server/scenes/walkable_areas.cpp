#include "server/scenes/walkable_areas.h"

#include <chrono>
#include <optional>
#include <system_error>
#include <utility>

#include "render_core/base/error.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/walk/walk_file.h"
#include "server/base/log_event.h"
#include "server/net/http.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

/// Throws InputError, unless the bytes read well. Empty ones say that there is no walkable area.
void check_walk_file(const ByteSource& bytes) {
  if (bytes.size() > 0) walk::read_walk_file(bytes);
}

}  // namespace

void WalkableAreas::find(const std::string& scene_id, WalkableAreaSource source,
                         std::function<void(std::shared_ptr<const WalkableArea>)> found) {
  busy_ = true;
  jobs_.start_then(
      lanes.walkable_areas, Priority::normal,
      [this, scene_id, source = std::move(source)](const std::stop_token& stop) {
        return find_now(scene_id, source, stop);
      },
      [this, scene_id, found = std::move(found)](Finished<std::string> bytes) {
        busy_ = false;
        std::shared_ptr<WalkableArea> walkable_area;
        if (bytes.result) walkable_area = std::make_shared<WalkableArea>();
        if (bytes.result && !bytes.result->empty()) {
          walkable_area->etag = etag_of(*bytes.result);
          walkable_area->file = std::make_shared<const std::string>(*std::move(bytes.result));
        }
        if (!bytes.error.empty())
          log_warning({.event = "ground_failed", .scene = scene_id},
                      "scene {}: its walkable area is not found: {}", scene_id, bytes.error);
        found(walkable_area);
      });
}

std::string WalkableAreas::find_now(const std::string& scene_id, const WalkableAreaSource& source,
                                    const std::stop_token& stop) const {
  std::error_code error;
  if (!source.beside.empty() && fs::exists(source.beside, error)) {
    try {
      const auto bytes = FileSource(source.beside).read_all(max_file_bytes);
      if (bytes.empty()) throw InputError(source.beside.string(), "", "is empty");
      check_walk_file(MemorySource(source.beside.string(), bytes));
      log_info({.event = "ground_found", .scene = scene_id}, "scene {}: people walk by {}",
               scene_id, source.beside.string());
      return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
    } catch (const InputError& failure) {
      log_warning({.event = "ground_unusable", .scene = scene_id},
                  "scene {}: its walkable area is computed, because {}", scene_id, failure.what());
    }
  }
  return kept_or_computed(scene_id, source, stop);
}

std::string WalkableAreas::kept_or_computed(const std::string& scene_id,
                                            const WalkableAreaSource& source,
                                            const std::stop_token& stop) const {
  const std::string name = files_ ? walkable_area_name(source) : "";
  if (auto bytes = files_ ? files_->read(name, max_file_bytes, check_walk_file) : std::nullopt)
    return *std::move(bytes);
  const TimePoint begin = Clock::now();
  std::string bytes;
  try {
    bytes = compute_walkable_area(source, threads_, [&] { throw_if_stopped(stop); });
    if (bytes.size() > max_file_bytes)
      throw NoWalkableArea(InputError(source.scene.given.string(), "",
                                      "has a walkable area that is too large for pages"));
    log_info({.event = "ground_found", .scene = scene_id},
             "scene {}: its walkable area was found in {:.1f} s and takes {} kB", scene_id,
             std::chrono::duration<double>(Clock::now() - begin).count(), bytes.size() / 1000);
  } catch (const NoWalkableArea& failure) {
    log_info({.event = "ground_missing", .scene = scene_id}, "scene {}: nobody can walk in it: {}",
             scene_id, failure.what());
  }
  if (files_) files_->write(name, bytes, DerivedFiles::most_walkable_areas);
  return bytes;
}

}  // namespace catgs
