#pragma once

#include <future>
#include <memory>
#include <string>

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>

#include "server/net/http.h"
#include "server/scene_library.h"

namespace catgs {

/// Writes the sidecars that authors send beside their scenes, and puts them in force: who comes or
/// reloads from then on begins where the new one says and gets its tours, and the poster is made
/// anew. Who looks at the scene meanwhile stays undisturbed. What a sidecar leaves out stays as it
/// is until the server starts anew.
class SidecarSaver {
 public:
  /// `io` runs the session thread and outlives this.
  SidecarSaver(SceneLibrary& scenes, boost::asio::io_context& io) : scenes_(scenes), io_(io) {}
  ~SidecarSaver() { writer_.join(); }
  SidecarSaver(const SidecarSaver&) = delete;
  SidecarSaver& operator=(const SidecarSaver&) = delete;

  /// Any thread. The answer comes when visitors get what was saved; whether the sender may save is
  /// the caller's to know.
  std::future<HttpResponse> save(std::string scene_id, std::string json);

 private:
  using Answer = std::shared_ptr<std::promise<HttpResponse>>;
  void write(const std::string& scene_id, const std::string& json,
             std::shared_ptr<const SceneEntry> entry, const Answer& answer);

  SceneLibrary& scenes_;
  boost::asio::io_context& io_;
  boost::asio::thread_pool writer_{
      1};  // disks are slow: neither sockets nor sessions wait for them
};

}  // namespace catgs
