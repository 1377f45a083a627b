#include "server/sidecar_saver.h"

#include <filesystem>
#include <span>
#include <string_view>
#include <utility>

#include <boost/asio/post.hpp>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "render_core/base/error.h"
#include "server/poster.h"
#include "server/replace_file.h"
#include "server/tours.h"

namespace catgs {
namespace {

SceneHints hints_of(const SceneFacts& facts) {
  SceneHints hints;
  hints.up = facts.up;
  hints.start_pose = facts.start_pose;
  hints.near_z = facts.near_z;
  hints.limits = {facts.limits_min, facts.limits_max};
  hints.focus = facts.focus;
  return hints;
}

/// The scene as its new sidecar wants it shown.
std::shared_ptr<const SceneEntry> revised(const SceneEntry& entry, const Sidecar& sidecar,
                                          const std::optional<std::string>& text) {
  SceneHints hints = hints_of(entry.facts);
  use_sidecar(sidecar, entry.sidecar.filename().string(), hints);
  auto scene = std::make_shared<SceneEntry>(entry);
  scene->facts.up = hints.up;
  scene->facts.start_pose = hints.start_pose;
  scene->facts.near_z = hints.near_z;
  scene->facts.limits_min = hints.limits.min;
  scene->facts.limits_max = hints.limits.max;
  scene->facts.focus = hints.focus;
  scene->tours = ToursAnswers(tours_of(entry.sidecar, text));
  if (auto poster = make_poster(*scene->renderer, scene->facts)) scene->poster = std::move(poster);
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

}  // namespace

std::future<HttpResponse> SidecarSaver::save(std::string scene_id, std::string json,
                                             Precondition precondition) {
  auto request = std::make_shared<Request>(
      Request{std::move(scene_id), std::move(json), std::move(precondition)});
  auto future = request->answer.get_future();
  boost::asio::post(io_, [this, request = std::move(request)] {
    request->entry = scenes_.in_memory(request->scene_id);
    if (!request->entry)
      return request->answer.set_value(
          text_response(409, "409: the scene is not in memory: open it, then save\n"));
    if (request->entry->sidecar.empty())
      return request->answer.set_value(
          text_response(409, "409: this scene is no file: there is nowhere to save beside it\n"));
    boost::asio::post(writer_, [this, request] { write(request); });
  });
  return future;
}

void SidecarSaver::write(const SharedRequest& request) {
  const std::string& json = request->json;
  const std::filesystem::path& file = request->entry->sidecar;
  Sidecar sidecar;
  try {
    sidecar = check_sent_sidecar(json);
  } catch (const InputError& mistake) {
    return request->answer.set_value(text_response(400, fmt::format("400: {}\n", mistake.what())));
  }
  try {
    // Read once: another server may replace it meanwhile.
    const std::optional<std::string> there = sidecar_text(file);
    const std::string current = there ? etag_of(*there) : "";
    if (!request->precondition.holds(current)) {
      spdlog::info("scene {}: an author's sidecar was made from an older one than {}",
                   request->scene_id, file.string());
      return put_in_force(
          request, there ? sidecar_in(file, *there) : Sidecar(), there,
          tagged(412, "412: somebody else saved this scene since you opened it\n", current));
    }
    replace_file(file, json);
    spdlog::info("scene {}: an author saved {} ({} bytes)", request->scene_id, file.string(),
                 json.size());
    put_in_force(request, sidecar, json, tagged(200, "saved\n", etag_of(json)));
  } catch (const InputError& unwritable) {
    spdlog::warn("scene {}: an author cannot save: {}", request->scene_id, unwritable.what());
    std::string why = unwritable.what();
    const std::string path = file.string();  // the operator's matter
    if (why.starts_with(path)) why.replace(0, path.size(), file.filename().string());
    request->answer.set_value(text_response(409, fmt::format("409: {}\n", why)));
  }
}

void SidecarSaver::put_in_force(const SharedRequest& request, const Sidecar& sidecar,
                                const std::optional<std::string>& text, HttpResponse answer) {
  auto scene = revised(*request->entry, sidecar, text);
  boost::asio::post(io_, [this, request, scene = std::move(scene), answer = std::move(answer)] {
    scenes_.revise(request->scene_id, scene);
    request->answer.set_value(answer);
  });
}

}  // namespace catgs
