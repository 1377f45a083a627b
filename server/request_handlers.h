#pragma once

#include <atomic>
#include <optional>

#include <boost/asio/io_context.hpp>

#include "server/access/access.h"
#include "server/base/liveness.h"
#include "server/base/metrics.h"
#include "server/config/config.h"
#include "server/counts/visits_page.h"
#include "server/films/film_renderer.h"
#include "server/net/static_files.h"
#include "server/scenes/media_api.h"
#include "server/scenes/scene_api.h"
#include "server/scenes/scene_library.h"
#include "server/scenes/sidecar_saver.h"
#include "server/visit/sessions.h"

namespace catgs {

class DeviceSet;

/// The client of --client-dir, or the one that was built with this program.
StaticFiles find_client(const std::string& client_dir);

/// Answers the requests of both ports: the functions of routes.h use it.
struct RequestHandlers {
  /// All outlive the handlers.
  struct Parts {
    boost::asio::io_context& io;  // runs the session thread
    Background& background;
    const ServerConfig& config;
    SceneLibrary& scenes;
    AccessControl& access;
    Authorize authorize;
    const Sessions& sessions;
    const DeviceSet& devices;
    const Liveness& liveness;
    const std::atomic<bool>& ready;
    Metrics& metrics;
    const StaticFiles& client;
    const UsageStatistics* statistics;  // null: visits are not counted
  };
  explicit RequestHandlers(Parts around);

  const Parts parts;
  SceneApi scenes;
  MediaApi media;
  std::optional<VisitsPage> visits;
  SidecarSaver saver;
  FilmRenderer films;

 private:
  /// Removes what killed servers have left where authors save.
  void remove_stale_files();
};

}  // namespace catgs
