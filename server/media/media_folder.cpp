#include "server/media/media_folder.h"

#include <algorithm>
#include <span>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "render_core/base/error.h"
#include "server/base/read_at.h"
#include "server/base/replace_file.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

/// A descriptor that is closed at its end; -1: none.
class Descriptor {
 public:
  explicit Descriptor(int descriptor) : descriptor_(descriptor) {}
  ~Descriptor() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int get() const { return descriptor_; }

 private:
  const int descriptor_;
};

/// A file of the folder, open for reading.
struct OpenFile {
  Descriptor descriptor;
  struct stat facts {};

  OpenFile(const fs::path& folder, const std::string& name) : descriptor(open_in(folder, name)) {
    if (descriptor.get() >= 0 && ::fstat(descriptor.get(), &facts) != 0) facts = {};
  }
  [[nodiscard]] bool good() const { return S_ISREG(facts.st_mode); }
  [[nodiscard]] std::string etag() const {
    return fmt::format("\"{:x}-{:x}-{:x}.{:x}\"", facts.st_ino, facts.st_size, facts.st_mtim.tv_sec,
                       facts.st_mtim.tv_nsec);
  }
  [[nodiscard]] std::string read(std::uint64_t offset, std::size_t bytes) const {
    std::string content(bytes, '\0');
    content.resize(read_at(descriptor.get(), offset, std::as_writable_bytes(std::span(content))));
    return content;
  }

 private:
  /// Opens no pipe that waits for a writer, and no link that leads out of the folder.
  static int open_in(const fs::path& folder, const std::string& name) {
    if (!is_media_name(name)) return -1;
    const Descriptor at(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (at.get() < 0) return -1;
    return ::openat(at.get(), name.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  }
};

constexpr std::string_view by_hand = "let the operator put the file into that folder";

}  // namespace

MediaFolder::MediaFolder(const fs::path& sidecar)
    : path_(fs::path(sidecar).replace_extension(media_folder_extension)) {}

std::optional<MediaFile> MediaFolder::find(const std::string& name) const {
  const OpenFile file(path_, name);
  if (!file.good()) return std::nullopt;
  const MediaType* type = media_type_of(file.read(0, media_head_bytes));
  if (!type) return std::nullopt;
  return MediaFile{name, type, static_cast<std::uint64_t>(file.facts.st_size), file.etag()};
}

std::string MediaFolder::read(const std::string& name, const std::string& etag,
                              std::uint64_t offset, std::size_t bytes) const {
  const OpenFile file(path_, name);
  return file.good() && file.etag() == etag ? file.read(offset, bytes) : std::string();
}

std::vector<MediaFile> MediaFolder::list() const {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(path_, error), end; !error && entry != end;
       entry.increment(error)) {
    if (names.size() >= max_media_files) break;
    const std::string name = entry->path().filename().string();
    if (is_media_name(name)) names.push_back(name);
  }
  std::ranges::sort(names);
  std::vector<MediaFile> files;
  for (const std::string& name : names)
    if (auto file = find(name)) files.push_back(*std::move(file));
  return files;
}

bool MediaFolder::save(const std::string& name, std::string_view content,
                       const MayReplace& may_replace,
                       const std::function<bool()>& somebody_waits) const {
  check_media(name, content);
  std::error_code error;
  fs::create_directory(path_, error);
  if (error)
    throw InputError(
        path_.filename().string(), {},
        fmt::format("this folder cannot be made beside the scene: {}", error.message()),
        "let the operator make it, writable for the server");
  require_room(name, content.size());
  Replacement fresh(path_ / name, content, by_hand);  // this may take long, and without the lock
  const FileLock lock = lock_for_saving(path_, save_patience, somebody_waits);
  const std::optional<MediaFile> there = find(name);
  if (!may_replace(there ? there->etag : "")) return false;
  require_room(name, content.size());
  fresh.take_place();
  return true;
}

/// Counts all that lies in the folder, whatever it is, but for the server's own hidden files.
void MediaFolder::require_room(const std::string& name, std::uint64_t bytes) const {
  std::size_t files = 1;
  std::error_code error;
  for (fs::directory_iterator entry(path_, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string other = entry->path().filename().string();
    if (other == name || other.starts_with('.')) continue;
    std::error_code no_file;
    const std::uint64_t size = entry->file_size(no_file);
    if (!no_file) bytes += size;
    if (++files > max_media_files || bytes > max_media_folder_bytes)
      throw InputError(path_.filename().string(), {},
                       fmt::format("is full: {} files and {} MiB at most", max_media_files,
                                   max_media_folder_bytes >> 20),
                       "let the operator delete what no tour shows any more");
  }
}

}  // namespace catgs
