#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "server/net/http.h"

namespace catgs {

/// The folder of the built client of an installation (prefix/bin) or of a build tree (build/bin);
/// empty if there is none.
std::filesystem::path built_client();

/// Serves the browser client from memory. Requests are looked up in a map and never touch the file
/// system, so no path from the wire can leave the folder.
class StaticFiles {
 public:
  StaticFiles() = default;
  /// Reads every regular file under `folder`. Throws InputError when it is no folder, has no
  /// index.html or exceeds 4,096 files or 256 MiB.
  explicit StaticFiles(const std::filesystem::path& folder);

  /// Answers with 200, 304 or 404. "/" is index.html. Names with a content hash (assets/) are
  /// cached for a year; the others are revalidated by ETag.
  [[nodiscard]] HttpResponse respond(const HttpRequest& request) const;

  /// Serves "/" and "/index.html" with `head` added to the end of the page's <head>.
  [[nodiscard]] HttpResponse respond_with_head(const HttpRequest& request,
                                               std::string_view head) const;

  [[nodiscard]] bool empty() const { return files_.empty(); }

 private:
  struct File {
    std::string content_type;
    std::string cache_control;
    std::string etag;
    std::shared_ptr<const std::string> body;
    std::shared_ptr<const std::string> gzip_body;  // null: compression saves nothing
  };
  static HttpResponse respond_with(const File& file, const HttpRequest& request);

  std::map<std::string, File, std::less<>> files_;  // by request path, "/assets/x.js"
};

}  // namespace catgs
