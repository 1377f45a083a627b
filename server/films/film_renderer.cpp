#include "server/films/film_renderer.h"

#include <array>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "server/base/log_event.h"
#include "server/films/film_worker.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto longest_job = 2h;
constexpr auto ask_again = 250ms;  // for a scene

HttpResponse json_response(int status, const nlohmann::json& document) {
  return text_response(status,
                       document.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace),
                       "application/json");
}

HttpResponse no_such_job() {
  return text_response(404, "404: there is no such picture or film, or not any more\n");
}

}  // namespace

HttpResponse FilmRenderer::result(std::string_view id) {
  const auto job = find(id);
  if (job && !has_ended(*job))
    return text_response(
        404, fmt::format("404: it is not ready yet: /api/films/{} says how far it is\n", id));
  if (!job || !job->result) return no_such_job();
  HttpResponse response;
  response.content_type = job->kind == FilmKind::film ? "video/mp4" : "image/png";
  response.disk_body = std::make_shared<const DiskBody>(
      DiskBody{job->result->size(), [file = job->result](std::uint64_t offset, std::size_t bytes) {
                 std::string piece(bytes, '\0');
                 if (!file->read(offset, std::as_writable_bytes(std::span(piece)))) piece.clear();
                 return piece;
               }});
  return response;
}

HttpResponse FilmRenderer::report(std::string_view id) {
  const auto job = find(id);
  if (!job) return no_such_job();
  constexpr std::array names = {"waiting", "drawing", "done", "failed", "cancelled"};
  nlohmann::json report = {{"state", names[static_cast<std::size_t>(job->state)]},
                           {"share", job->share}};
  if (const auto left = queue_->left(*job)) report["seconds_left"] = left->count();
  if (job->result) report["bytes"] = job->result->size();
  if (!job->error.empty()) report["error"] = job->error;
  return json_response(200, report);
}

std::optional<FilmReport> FilmRenderer::find(std::string_view id) {
  auto job = queue_->find(id);
  return job && !around_.ended(job->owner) ? job : std::nullopt;
}

std::optional<HttpResponse> FilmRenderer::refuse_cancel(std::string_view id) {
  const auto job = find(id);
  return job && !has_ended(*job) ? std::nullopt : std::optional(no_such_job());
}

HttpResponse FilmRenderer::cancel(std::string_view id) {
  if (auto refusal = refuse_cancel(id)) return *std::move(refusal);
  return queue_->cancel(id) ? text_response(200, "cancelled\n") : no_such_job();
}

std::future<HttpResponse> FilmRenderer::order(std::string scene_id, std::string owner,
                                              std::string json,
                                              std::shared_ptr<const UploadSlot> slot) {
  auto answer = std::make_shared<std::promise<HttpResponse>>();
  auto future = answer->get_future();
  // An order is too long to be read on the network thread.
  jobs_.start(lanes.film_requests, Priority::normal,
              [this, answer, scene_id = std::move(scene_id), owner = std::move(owner),
               json = std::move(json), slot = std::move(slot)](const auto&) mutable {
                if (slot->abandoned()) return;
                HttpResponse response = take(std::move(scene_id), std::move(owner), json);
                std::string().swap(json);
                slot.reset();  // it is free before the answer comes
                answer->set_value(std::move(response));
              });
  return future;
}

HttpResponse FilmRenderer::take(std::string scene_id, std::string owner, const std::string& json) {
  FilmRequest request;
  try {
    request = parse_film_request(json);
  } catch (const InputError& mistake) {
    return text_response(400, fmt::format("400: {}\n", mistake.what()));
  }
  const auto added = queue_->add(scene_id, std::move(owner), std::move(request));
  if (const auto* refused = std::get_if<FilmQueue::Refused>(&added))
    return refused->has_one
               ? text_response(409, "409: you have ordered one already: wait for it or cancel it\n")
               : busy_response("503: others wait for theirs: try again in a few minutes\n");
  log_info({.event = "film_ordered", .scene = scene_id},
           "scene {}: an author ordered a film or picture", scene_id);
  const auto& id = std::get<std::string>(added);
  boost::asio::post(around_.io, [queue = queue_, lease = around_.lease, scene_id, id] {
    if (const auto held = lease(scene_id, false).lease) queue->found_scene(id, held->content());
  });
  jobs_.start(lanes.films, Priority::normal, [this](const std::stop_token& stop) {
    if (const auto job = queue_->start_next()) draw(*job, stop);
  });
  return json_response(202, {{"id", id}});
}

void FilmRenderer::check(const FilmJob& job, double share, const std::stop_token& stop) {
  if (around_.ended(job.owner)) queue_->cancel(job.id);
  if (stop.stop_requested() || !queue_->drawn(job.id, share)) throw Cancelled();
}

void FilmRenderer::draw(const FilmJob& job, const std::stop_token& stop) {
  const TimePoint started = Clock::now();
  double done = 0.0;
  std::optional<int> content = job.content;
  const auto take = [&] {
    const LeasedScene scene = take_scene(job, done, content, stop);
    content = scene.lease->content();
    return scene;
  };
  try {
    const auto file = std::make_shared<ResultFile>();
    draw_film(job.request, take, *file, [&](double share, Clock::duration took) {
      check(job, done = share, stop);
      if (Clock::now() - started > longest_job) throw NotDrawn("it takes longer than two hours");
      if (around_.visitors_look()) sleep_unless_stopped(took, stop);
    });
    queue_->finish(job.id, file);
  } catch (const Cancelled&) {
    return;
  } catch (const std::exception& failure) {
    log_warning({.event = "film_failed", .scene = job.scene_id}, "scene {}: no film: {}",
                job.scene_id, failure.what());
    const bool for_authors = dynamic_cast<const NotDrawn*>(&failure) != nullptr;
    queue_->fail(job.id, for_authors ? failure.what() : "the server failed to draw it: try again");
  }
}

LeasedScene FilmRenderer::take_scene(const FilmJob& job, double share, std::optional<int> content,
                                     const std::stop_token& stop) {
  const TimePoint begun = Clock::now();
  while (true) {
    const LeasedScene scene = ask_session_thread(
        around_.io, stop, [&] { return around_.lease(job.scene_id, content.has_value()); });
    if (scene.lease && content && scene.lease->content() != *content)
      throw NotDrawn("the scene's file has changed meanwhile: order again");
    if (scene.lease) return scene;
    if (!content) throw NotDrawn("the scene is not in memory: open it, and order again");
    if (scene.gone) throw NotDrawn("the scene is not offered any more");
    if (Clock::now() - begun >= around_.longest_wait)
      throw NotDrawn(
          "visitors of other scenes need the memory of this one: order again when it is quieter");
    sleep_unless_stopped(ask_again, stop);
    check(job, share, stop);
  }
}

}  // namespace catgs
