#pragma once

#include <future>
#include <memory>
#include <optional>
#include <string>

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>

#include "render_core/scene/files/hints.h"
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
  /// the caller's to know. Where the sidecar that is there is not the one that `precondition` asks
  /// for, it stays, is put in force itself (another server may have written it), and the answer is
  /// 412 with its tag. Requests are taken one after the other; two servers over one folder that are
  /// asked at the same moment may both find the old one, and the later one's stays.
  std::future<HttpResponse> save(std::string scene_id, std::string json, Precondition precondition);

 private:
  struct Request {
    std::string scene_id;
    std::string json;
    Precondition precondition;
    std::shared_ptr<const SceneEntry> entry{};
    std::promise<HttpResponse> answer{};
  };
  using SharedRequest = std::shared_ptr<Request>;
  void write(const SharedRequest& request);
  /// Answers when visitors get what the sidecar says. `text`: all of it; nothing: there is none.
  void put_in_force(const SharedRequest& request, const Sidecar& sidecar,
                    const std::optional<std::string>& text, HttpResponse answer);

  SceneLibrary& scenes_;
  boost::asio::io_context& io_;
  boost::asio::thread_pool writer_{
      1};  // disks are slow: neither sockets nor sessions wait for them
};

}  // namespace catgs
