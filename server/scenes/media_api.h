#pragma once

#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <boost/asio/thread_pool.hpp>

#include "server/access/authorize.h"
#include "server/media/media_folder.h"
#include "server/net/http.h"
#include "server/net/upload_places.h"
#include "server/scenes/scene_library.h"

namespace catgs {

/// Answers requests for the media of scenes: "/api/scenes/ID/media" and paths below it. Network
/// thread; files are read on the disk's threads and written on one of its own.
///
/// - GET media/NAME: the file, for those who may see the scene. Elements of a page cannot send a
///   token, so a pass in the address does as well: media/NAME?pass=PASS.
/// - GET media-pass: such a pass, for the holder of a token. It is good for this scene and some
///   hours, and for no longer than the token is.
/// - GET media: the list of files, for authors.
/// - PUT media/NAME: adds or replaces a file, for authors.
class MediaApi {
 public:
  struct Parts {
    const SceneLibrary& scenes;
    Authorize authorize;
    Ended ended;
    std::string key;  // of passes; servers of a fleet share it
    std::function<std::int64_t()> now_unix_s;
  };
  explicit MediaApi(Parts parts) : parts_(std::move(parts)) {}
  ~MediaApi() { writer_.join(); }
  MediaApi(const MediaApi&) = delete;
  MediaApi& operator=(const MediaApi&) = delete;

  /// Returns nothing for any other path.
  std::optional<HttpResponse> respond(const HttpRequest& request);

  /// True for "/api/scenes/ID/media/NAME", whatever the name.
  static bool is_file(std::string_view path);
  /// Returns the refusal of an upload to such a path, or nothing.
  std::optional<HttpResponse> refuse_upload(const HttpRequest& request);
  /// Saves an accepted upload. See HttpUploads::take.
  std::future<HttpResponse> save(const HttpRequest& request, std::string content,
                                 std::shared_ptr<const UploadPlace> place);

 private:
  /// Returns why a request may not see a scene; nothing: it may.
  Refusal refusal(const HttpRequest& request, std::string_view scene_id) const;
  [[nodiscard]] bool has_pass(const HttpRequest& request, std::string_view scene_id) const;
  HttpResponse make_pass(const HttpRequest& request, const std::string& scene_id) const;
  HttpResponse list(const HttpRequest& request, const std::string& scene_id) const;
  HttpResponse file(const HttpRequest& request, const std::string& scene_id,
                    const std::string& name) const;
  /// The folder of a scene in memory; nothing: the scene is not, or it is no file.
  [[nodiscard]] std::optional<MediaFolder> folder_of(std::string_view scene_id) const;

  const Parts parts_;
  boost::asio::thread_pool writer_{1};
};

}  // namespace catgs
