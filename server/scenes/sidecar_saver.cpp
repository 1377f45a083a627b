#include "server/scenes/sidecar_saver.h"

#include <filesystem>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include <boost/asio/post.hpp>
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
  use_hints(hints, entry.name, scene->facts);
  scene->tours = ToursAnswers(tours_of(entry.sidecar, text, media_origins));
  scene->sidecar_tag = text ? etag_of(*text) : "";
  return scene;
}

Sidecar sidecar_in(const std::filesystem::path& file, std::string_view text) {
  return read_sidecar(MemorySource(file.string(), std::as_bytes(std::span(text))));
}

HttpResponse tagged(int status, std::string text, std::string etag) {
  HttpResponse response = text_response(status, std::move(text));
  response.etag = std::move(etag);
  return response;
}

HttpResponse stopping() { return busy_response("503: the server stops\n"); }

}  // namespace

std::future<HttpResponse> SidecarSaver::save(std::string scene_id, std::string json,
                                             Precondition precondition,
                                             std::shared_ptr<const UploadPlace> place) {
  auto request = std::make_shared<Request>(
      Request{std::move(scene_id), std::move(json), std::move(precondition), std::move(place)});
  auto future = request->answer.get_future();
  boost::asio::post(io_, [this, request = std::move(request)] {
    if (stopped_) return request->answer.set_value(stopping());
    waiting_.push_back(request);
    start_next();
  });
  return future;
}

void SidecarSaver::stop() {
  stopped_ = true;
  for (const SharedRequest& request : waiting_) request->answer.set_value(stopping());
  waiting_.clear();
}

/// Saves run first, because those that wait together need only one poster.
void SidecarSaver::start_next() {
  while (!busy_ && !waiting_.empty()) {
    const SharedRequest request = std::move(waiting_.front());
    waiting_.pop_front();
    if (!request->place->abandoned()) start_save(request);
  }
  while (!busy_ && !stopped_ && !posters_due_.empty())
    start_poster(posters_due_.extract(posters_due_.begin()).value());
}

void SidecarSaver::start_save(const SharedRequest& request) {
  request->entry = scenes_.lease(request->scene_id).entry;
  if (!request->entry)
    return request->answer.set_value(
        text_response(409, "409: the scene is not in memory: open it, then save\n"));
  if (request->entry->sidecar.empty())
    return request->answer.set_value(
        text_response(409, "409: this scene is generated, so there is no file to save beside\n"));
  busy_ = true;
  boost::asio::post(writer_, [this, request] {
    Outcome outcome;
    try {
      outcome = write(*request);
    } catch (const std::exception& failure) {  // memory, say: it costs this save only
      log_error({.event = "save_failed", .scene = request->scene_id}, "scene {}: a save failed: {}",
                request->scene_id, failure.what());
      outcome.answer = text_response(500, "500: the server failed to save: try again\n");
    }
    boost::asio::post(io_,
                      [this, request, outcome = std::move(outcome)] { finish(*request, outcome); });
  });
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
      refused.revised = revised(scene, there ? sidecar_in(scene.sidecar, *there) : Sidecar(), there,
                                media_origins_);
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
    sidecar = check_sent_sidecar(request.json, media_origins_);
  } catch (const InputError& mistake) {
    return {text_response(400, fmt::format("400: {}\n", mistake.what()))};
  }
  try {
    Replacement fresh(file, request.json, beside_the_scene);
    const FileLock lock = lock_for_saving(file.parent_path(), save_patience,
                                          [&] { return !request.place->abandoned(); });
    // Read it once, because somebody may replace it by hand meanwhile.
    const std::optional<std::string> there = sidecar_text(file);
    const std::string current = there ? etag_of(*there) : "";
    if (!request.precondition.holds(current)) return refuse_outdated(request, there, current);
    auto shown =
        revised(scene, sidecar, request.json, media_origins_);  // throws before any file is changed
    if (request.place->abandoned()) return {text_response(503, "503: the connection is closed\n")};
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
  boost::asio::post(writer_, [folders = std::move(folders)] {
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

void SidecarSaver::finish(Request& request, const Outcome& outcome) {
  busy_ = false;
  if (outcome.revised) {
    if (!outcome.revised->poster || !same_poster(outcome.revised->facts, request.entry->facts))
      posters_due_.insert(request.scene_id);
    scenes_.revise(request.scene_id, outcome.revised);
  }
  request.answer.set_value(outcome.answer);
  start_next();
}

void SidecarSaver::start_poster(const std::string& scene_id) {
  auto scene = scenes_.lease(scene_id).entry;
  if (!scene) return;
  busy_ = true;
  boost::asio::post(writer_, [this, scene_id, scene = std::move(scene)] {
    auto shown = std::make_shared<SceneEntry>(*scene);
    if (auto poster = make_poster(*shown->renderer, shown->facts))
      shown->poster = std::move(poster);
    boost::asio::post(io_, [this, scene_id, shown = std::move(shown)] {
      busy_ = false;
      scenes_.revise(scene_id, shown);
      start_next();
    });
  });
}

}  // namespace catgs
