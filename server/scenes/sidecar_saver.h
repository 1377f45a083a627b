#pragma once

#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <boost/asio/io_context.hpp>

#include "server/base/background.h"
#include "server/net/http.h"
#include "server/net/upload_slots.h"
#include "server/scenes/scene_library.h"

namespace catgs {

/// Writes the sidecars that authors send and applies them. Clients that arrive or reload afterwards
/// get the new start view and tours. Present clients are not disturbed. The poster is rendered
/// again when no save waits. Values that a sidecar leaves out stay as they are until a restart.
class SidecarSaver {
 public:
  /// `io` runs the session thread and outlives this object. `media_origins`: sites that tours may
  /// show media of.
  SidecarSaver(SceneLibrary& scenes, Background& background, boost::asio::io_context& io,
               std::vector<std::string> media_origins = {})
      : scenes_(scenes), io_(io), media_origins_(std::move(media_origins)), jobs_(background) {}

  /// Any thread. The future is ready when visitors get the saved sidecar. The caller has checked
  /// the sender's permission. If the sidecar on disk does not meet `precondition`, it is kept and
  /// applied, as another server may have written it. The answer is then 412 with its tag. Servers
  /// that share a folder look at the sidecar and replace it one after the other. Requests run one
  /// after the other, too; one with an abandoned slot is dropped.
  std::future<HttpResponse> save(std::string scene_id, std::string json, Precondition precondition,
                                 std::shared_ptr<const UploadSlot> slot);

  /// Removes what killed servers have left in these folders and in the media folders there.
  void remove_stale_files_in(std::set<std::filesystem::path> folders);

  /// The current save finishes. Waiting and later saves are answered with 503.
  void stop() { jobs_.close(); }

 private:
  struct Request {
    ~Request();  // answers

    std::string scene_id{};
    std::string json{};
    Precondition precondition{};
    std::shared_ptr<const UploadSlot> slot{};
    std::shared_ptr<const SceneEntry> entry{};
    std::promise<HttpResponse> promise{};
    HttpResponse answer =
        busy_response("503: the server cannot do it now: try again in a moment\n");
  };
  struct Outcome {
    HttpResponse answer;
    std::shared_ptr<const SceneEntry> revised{};  // null: the scene stays as it is
  };

  // In the background.
  HttpResponse answer(Request& request, const std::stop_token& stop);
  void render_poster(const std::string& scene_id, const std::stop_token& stop);
  [[nodiscard]] Outcome write(const Request& request) const;
  [[nodiscard]] Outcome refuse_outdated(const Request& request,
                                        const std::optional<std::string>& there,
                                        const std::string& tag) const;

  /// Session thread.
  HttpResponse apply(const Request& request, const Outcome& outcome);

  SceneLibrary& scenes_;
  boost::asio::io_context& io_;
  const std::vector<std::string> media_origins_;
  std::set<std::string> posters_due_;  // ids of scenes; session thread
  Background::Jobs jobs_;
};

}  // namespace catgs
