#pragma once

#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "server/access/authorize.h"
#include "server/access/session_tokens.h"
#include "server/base/background.h"
#include "server/media/media_folder.h"
#include "server/net/http.h"
#include "server/net/upload_slots.h"
#include "server/scenes/scene_library.h"

namespace catgs {

/// Answers requests for the media of scenes, whose senders may see or change them (routes.h).
/// Network thread; files are read and written in the background.
class MediaApi {
 public:
  struct Parts {
    const SceneLibrary& scenes;
    Background& background;
    Ended ended;
    SessionTokens tokens;
    std::function<std::int64_t()> now_unix_s;
  };
  explicit MediaApi(Parts parts) : parts_(std::move(parts)), jobs_(parts_.background) {}

  /// True if the address has a pass to the scene's tours and media: "?pass=PASS".
  [[nodiscard]] bool has_pass(const HttpRequest& request, std::string_view scene_id) const;
  /// Such a pass, for the holder of a token.
  [[nodiscard]] HttpResponse make_pass(const std::string& scene_id, const Permit& permit) const;
  [[nodiscard]] HttpResponse list(const std::string& scene_id) const;
  [[nodiscard]] HttpResponse file(const HttpRequest& request, const std::string& scene_id,
                                  const std::string& name) const;
  /// Refuses an author's upload by its name, or returns nothing.
  [[nodiscard]] std::optional<HttpResponse> refuse_upload(const std::string& scene_id,
                                                          std::string_view name) const;
  /// Adds or replaces a file. See HttpUploads::take.
  std::future<HttpResponse> save(const HttpRequest& request, const std::string& scene_id,
                                 std::string name, std::string content,
                                 std::shared_ptr<const UploadSlot> slot);

 private:
  /// The folder of a scene in memory; nothing: the scene is not, or it is no file.
  [[nodiscard]] std::optional<MediaFolder> folder_of(std::string_view scene_id) const;

  const Parts parts_;
  Background::Jobs jobs_;
};

}  // namespace catgs
