#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/media/media_type.h"

namespace catgs {

inline constexpr std::size_t max_media_files = 256;  // of a scene
inline constexpr std::uint64_t max_media_folder_bytes = std::uint64_t{1} << 30;

/// A file that was looked at.
struct MediaFile {
  std::string name;
  const MediaType* type = nullptr;  // by its content
  std::uint64_t bytes = 0;
  std::string etag;  // changes with its content
};

/// The pictures, films and sounds of a scene's tours: `<scene>.media` beside `<scene>.json`. All
/// functions read or write the disk. Files are regular ones directly in the folder; symbolic links
/// are not followed. Errors and names come without the folder's path.
class MediaFolder {
 public:
  /// `sidecar`: the path of the scene's sidecar, even if there is no such file.
  explicit MediaFolder(const std::filesystem::path& sidecar);

  /// Returns nothing if there is no such file or its content is of no known format.
  [[nodiscard]] std::optional<MediaFile> find(const std::string& name) const;
  /// Reads up to `bytes` of a file; fewer at its end, or if it is no longer the one of `etag`.
  [[nodiscard]] std::string read(const std::string& name, const std::string& etag,
                                 std::uint64_t offset, std::size_t bytes) const;
  /// The files of known formats, in the order of their names; at most max_media_files.
  [[nodiscard]] std::vector<MediaFile> list() const;
  /// Decides, by the tag of the present file, whether it may be replaced. Empty: there is none.
  using MayReplace = std::function<bool(const std::string& etag)>;
  /// Adds or replaces a file that check_media() accepts. Makes the folder if it is missing. Servers
  /// that share a folder ask `may_replace` and replace the file one after the other. Returns false
  /// where it may not. Throws FolderBusy, at the latest when nobody waits any more, and InputError
  /// if the folder is full or cannot be written.
  bool save(
      const std::string& name, std::string_view content,
      const MayReplace& may_replace = [](const std::string&) { return true; },
      const std::function<bool()>& somebody_waits = [] { return true; }) const;

 private:
  void require_room(const std::string& name, std::uint64_t bytes) const;

  const std::filesystem::path path_;
};

}  // namespace catgs
