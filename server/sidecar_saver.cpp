#include "server/sidecar_saver.h"

#include <utility>

#include <boost/asio/post.hpp>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "render_core/error.h"
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
std::shared_ptr<const SceneEntry> revised(const SceneEntry& entry, const Sidecar& sidecar) {
  SceneHints hints = hints_of(entry.facts);
  use_sidecar(sidecar, entry.sidecar.filename().string(), hints);
  auto scene = std::make_shared<SceneEntry>(entry);
  scene->facts.up = hints.up;
  scene->facts.start_pose = hints.start_pose;
  scene->facts.near_z = hints.near_z;
  scene->facts.limits_min = hints.limits.min;
  scene->facts.limits_max = hints.limits.max;
  scene->facts.focus = hints.focus;
  scene->tours = read_tours(entry.sidecar);
  if (auto poster = make_poster(*scene->renderer, scene->facts)) scene->poster = std::move(poster);
  return scene;
}

}  // namespace

std::future<HttpResponse> SidecarSaver::save(std::string scene_id, std::string json) {
  auto answer = std::make_shared<std::promise<HttpResponse>>();
  auto future = answer->get_future();
  boost::asio::post(io_, [this, answer, scene_id = std::move(scene_id), json = std::move(json)] {
    auto entry = scenes_.in_memory(scene_id);
    if (!entry)
      return answer->set_value(
          text_response(409, "409: the scene is not in memory: open it, then save\n"));
    if (entry->sidecar.empty())
      return answer->set_value(
          text_response(409, "409: this scene is no file: there is nowhere to save beside it\n"));
    boost::asio::post(writer_, [this, scene_id, json, entry = std::move(entry), answer] {
      write(scene_id, json, entry, answer);
    });
  });
  return future;
}

void SidecarSaver::write(const std::string& scene_id, const std::string& json,
                         std::shared_ptr<const SceneEntry> entry, const Answer& answer) {
  Sidecar sidecar;
  try {
    sidecar = check_sent_sidecar(json);
  } catch (const InputError& mistake) {
    return answer->set_value(text_response(400, fmt::format("400: {}\n", mistake.what())));
  }
  try {
    replace_file(entry->sidecar, json);
    spdlog::info("scene {}: an author saved {} ({} bytes)", scene_id, entry->sidecar.string(),
                 json.size());
    auto scene = revised(*entry, sidecar);
    boost::asio::post(io_, [this, scene_id, scene = std::move(scene), answer] {
      scenes_.revise(scene_id, scene);
      answer->set_value(text_response(200, "saved\n"));
    });
  } catch (const InputError& unwritable) {
    spdlog::warn("scene {}: an author cannot save: {}", scene_id, unwritable.what());
    answer->set_value(text_response(409, fmt::format("409: {}\n", unwritable.what())));
  }
}

}  // namespace catgs
