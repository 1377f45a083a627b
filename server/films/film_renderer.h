#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include <boost/asio/io_context.hpp>

#include "server/access/authorize.h"
#include "server/base/background.h"
#include "server/films/film_queue.h"
#include "server/net/http.h"
#include "server/net/upload_slots.h"
#include "server/scenes/scene_lease.h"

namespace catgs {

/// Takes authors' orders of pictures and films, draws them one after the other in the background,
/// and hands out the results. A job's id is 128 random bits: whoever knows it may ask for
/// it, until its order's link is revoked. While visitors look at scenes, at most half of the time
/// is spent on drawing. A scene whose memory visitors need is let go between two pictures.
class FilmRenderer {
 public:
  struct Surroundings {
    boost::asio::io_context& io;  // runs the session thread
    Background& background;
    /// A hold on a scene in memory. `again`: it was in memory when the job was ordered. Session
    /// thread.
    std::function<LeasedScene(const std::string& scene_id, bool again)> lease;
    std::function<bool()> visitors_look;  // any thread
    Ended ended;                          // any thread
    /// A job whose scene was let go ends if it does not get the scene again in this time.
    std::chrono::milliseconds longest_wait = std::chrono::minutes(10);
  };
  /// Its end waits for that of the current part or row.
  explicit FilmRenderer(Surroundings around)
      : around_(std::move(around)), jobs_(around_.background) {}

  // Network thread. `id`: of a job.
  /// {"state", "share", "seconds_left", "bytes", "error"}
  HttpResponse report(std::string_view id);
  /// The picture or film.
  HttpResponse result(std::string_view id);
  /// Returns a refusal unless the job waits or is being drawn.
  std::optional<HttpResponse> refuse_cancel(std::string_view id);
  HttpResponse cancel(std::string_view id);
  /// Takes an order (film_request.h); answers 202 with {"id": JOB}. The caller has checked that the
  /// sender may save the scene. `owner`: id of its token. One whose slot is abandoned meanwhile
  /// orders nothing.
  std::future<HttpResponse> order(std::string scene_id, std::string owner, std::string json,
                                  std::shared_ptr<const UploadSlot> slot);

 private:
  /// Nothing: there is no such job, or its link was revoked.
  std::optional<FilmReport> find(std::string_view id);
  HttpResponse take(std::string scene_id, std::string owner, const std::string& json);
  void draw(const FilmJob& job, const std::stop_token& stop);
  /// Throws Cancelled when the server stops, or the job, of which `share` is done, was cancelled or
  /// its link revoked.
  void check(const FilmJob& job, double share, const std::stop_token& stop);
  /// Waits for a lease of the job's scene. `content`: of the lease before; nothing: there was none.
  /// Throws NotDrawn, or as check().
  LeasedScene take_scene(const FilmJob& job, double share, std::optional<int> content,
                         const std::stop_token& stop);

  const Surroundings around_;
  const std::shared_ptr<FilmQueue> queue_ = std::make_shared<FilmQueue>();
  Background::Jobs jobs_;
};

}  // namespace catgs
