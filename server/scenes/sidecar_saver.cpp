#include "server/scenes/sidecar_saver.h"

#include <filesystem>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "server/base/log_event.h"
#include "server/base/replace_file.h"
#include "server/media/media_folder.h"
#include "server/scenes/poster.h"
#include "server/scenes/scene_facts.h"
#include "server/scenes/tours.h"

namespace catgs {
namespace {

/// The scene's entry with its new sidecar applied.
std::shared_ptr<const SceneEntry> revised(const SceneEntry& entry, const Sidecar& sidecar,
                                          const std::optional<std::string>& text,
                                          const MediaOrigins& media_origins) {
  SceneHints hints = hints_of(entry.facts);
  use_sidecar(sidecar, entry.sidecar.filename().string(), hints);
  auto scene = std::make_shared<SceneEntry>(entry);
  use_hints(hints, entry.name, entry.surface.get(), scene->facts);
  scene->tours = ToursAnswers(tours_of(entry.sidecar, text, media_origins));
  scene->sidecar_tag = text ? etag_of(*text) : "";
  return scene;
}

/// The sidecar of an entry, with this content.
Sidecar sidecar_of(const SceneEntry& entry, std::string_view text) {
  return read_sidecar(MemorySource(entry.sidecar.string(), std::as_bytes(std::span(text))),
                      entry.facts.origin);
}

HttpResponse tagged(int status, std::string text, std::string etag) {
  HttpResponse response = text_response(status, std::move(text));
  response.etag = std::move(etag);
  return response;
}

}  // namespace

SidecarSaver::Request::~Request() {
  slot.reset();  // it is free before the answer comes
  promise.set_value(std::move(answer));
}

std::future<HttpResponse> SidecarSaver::save(std::string scene_id, std::string json,
                                             Precondition precondition,
                                             std::shared_ptr<const UploadSlot> slot) {
  const auto request = std::make_shared<Request>();
  request->scene_id = std::move(scene_id);
  request->json = std::move(json);
  request->precondition = std::move(precondition);
  request->slot = std::move(slot);
  auto future = request->promise.get_future();
  // Saves run before posters, because those that wait together need only one poster.
  jobs_.start(lanes.sidecars, Priority::high, [this, request](const std::stop_token& stop) {
    request->answer = answer(*request, stop);
  });
  return future;
}

HttpResponse SidecarSaver::answer(Request& request, const std::stop_token& stop) {
  if (request.slot->abandoned()) return busy_response("503: the connection is closed\n");
  request.entry =
      ask_session_thread(io_, stop, [&] { return scenes_.lease(request.scene_id).entry; });
  if (!request.entry)
    return text_response(409, "409: the scene is not in memory: open it, then save\n");
  if (request.entry->sidecar.empty())
    return text_response(409, "409: this scene is generated, so there is no file to save beside\n");
  Outcome outcome;
  try {
    outcome = write(request);
  } catch (const std::exception& failure) {  // memory, say: it costs this save only
    log_error({.event = "save_failed", .scene = request.scene_id}, "scene {}: a save failed: {}",
              request.scene_id, failure.what());
    return text_response(500, "500: the server failed to save: try again\n");
  }
  return ask_session_thread(io_, stop, [&] { return apply(request, outcome); });
}

/// `there`: what is in force instead, and its tag.
SidecarSaver::Outcome SidecarSaver::refuse_outdated(const Request& request,
                                                    const std::optional<std::string>& there,
                                                    const std::string& tag) const {
  const SceneEntry& scene = *request.entry;
  log_info({.event = "save_outdated", .scene = request.scene_id},
           "scene {}: an author's sidecar was made from an older one than {}", request.scene_id,
           scene.sidecar.string());
  Outcome refused{tagged(412, "412: somebody else saved this scene since you opened it\n", tag)};
  try {
    if (tag != scene.sidecar_tag)
      refused.revised =
          revised(scene, there ? sidecar_of(scene, *there) : Sidecar(), there, media_origins_);
  } catch (const InputError& broken) {
    log_warning({.event = "sidecar_unreadable", .scene = request.scene_id},
                "scene {}: stays as it was: {}", request.scene_id, broken.what());
  }
  return refused;
}

SidecarSaver::Outcome SidecarSaver::write(const Request& request) const {
  const SceneEntry& scene = *request.entry;
  const std::filesystem::path& file = scene.sidecar;
  Sidecar sidecar;
  try {
    sidecar = check_sent_sidecar(request.json, media_origins_, scene.facts.origin);
  } catch (const InputError& mistake) {
    return {text_response(400, fmt::format("400: {}\n", mistake.what()))};
  }
  try {
    Replacement fresh(file, request.json, beside_the_scene);
    const FileLock lock = lock_for_saving(file.parent_path(), save_patience,
                                          [&] { return !request.slot->abandoned(); });
    // Read it once, because somebody may replace it by hand meanwhile.
    const std::optional<std::string> there = sidecar_text(file);
    const std::string current = there ? etag_of(*there) : "";
    if (!request.precondition.holds(current)) return refuse_outdated(request, there, current);
    auto shown =
        revised(scene, sidecar, request.json, media_origins_);  // throws before any file is changed
    if (request.slot->abandoned()) return {text_response(503, "503: the connection is closed\n")};
    if (there != request.json) fresh.take_place_and_keep_old();
    log_info({.event = "saved", .scene = request.scene_id},
             "scene {}: an author saved {} ({} bytes)", request.scene_id, file.string(),
             request.json.size());
    return {tagged(200, "saved\n", etag_of(request.json)), std::move(shown)};
  } catch (const InputError& unwritable) {
    log_warning({.event = "save_failed", .scene = request.scene_id},
                "scene {}: an author cannot save: {}", request.scene_id, unwritable.what());
    if (dynamic_cast<const FolderBusy*>(&unwritable))
      return {busy_response(fmt::format("503: {}\n", unwritable.what()))};
    std::string why = unwritable.what();
    const std::string path = file.string();  // for the operator's log only
    if (why.starts_with(path)) why.replace(0, path.size(), file.filename().string());
    return {text_response(409, fmt::format("409: {}\n", why))};
  }
}

void SidecarSaver::remove_stale_files_in(std::set<std::filesystem::path> folders) {
  jobs_.start(lanes.sidecars, Priority::normal, [folders = std::move(folders)](const auto&) {
    for (const std::filesystem::path& folder : folders) {
      remove_stale_files(folder, surely_stale);
      std::error_code error;
      for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
           entry.increment(error))
        if (entry->path().extension() == media_folder_extension)
          remove_stale_files(entry->path(), surely_stale);
    }
  });
}

HttpResponse SidecarSaver::apply(const Request& request, const Outcome& outcome) {
  if (!outcome.revised) return outcome.answer;
  const std::string& id = request.scene_id;
  const bool same = same_poster(outcome.revised->facts, request.entry->facts);
  if ((!outcome.revised->poster || !same) && posters_due_.insert(id).second) {
    const auto job =
        jobs_.start(lanes.sidecars, Priority::normal,
                    [this, id](const std::stop_token& stop) { render_poster(id, stop); });
    if (job == 0) posters_due_.erase(id);  // the lane is full: the next save renders it
  }
  scenes_.revise(id, outcome.revised);
  return outcome.answer;
}

void SidecarSaver::render_poster(const std::string& scene_id, const std::stop_token& stop) {
  const auto scene = ask_session_thread(io_, stop, [&] {
    posters_due_.erase(scene_id);
    return scenes_.lease(scene_id).entry;
  });
  if (!scene) return;
  const auto shown = std::make_shared<SceneEntry>(*scene);
  if (auto poster = make_poster(*shown->renderer, shown->facts)) shown->poster = std::move(poster);
  ask_session_thread(io_, stop, [&] {
    scenes_.revise(scene_id, shown);
    return true;
  });
}

}  // namespace catgs
