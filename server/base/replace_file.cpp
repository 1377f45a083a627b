#include "server/base/replace_file.h"

#include <cerrno>
#include <cstdio>
#include <string>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view beside_the_scene =
    "download the file, and let the operator put it beside the scene";

[[noreturn]] void fail(const fs::path& file, int error, std::string_view remedy) {
  const bool read_only = error == EACCES || error == EPERM || error == EROFS;
  throw InputError(file.filename().string(), {},
                   read_only
                       ? "the folder is read-only for the server"
                       : fmt::format("cannot be written: {}",
                                     std::error_code(error, std::generic_category()).message()),
                   remedy);
}

/// A temporary file that is deleted unless it was moved away.
class NewFile {
 public:
  NewFile(const fs::path& target, std::string_view remedy)
      // The name is hidden, so that no one takes it for a scene's file.
      : path_(target.parent_path() / fmt::format(".{}.new", target.filename().string())),
        target_(target),
        remedy_(remedy),
        descriptor_(
            ::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0666)) {
    if (descriptor_ < 0) fail(target_, errno, remedy_);
  }
  ~NewFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!moved_) ::unlink(path_.c_str());
  }
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  void write(std::string_view text) {
    while (!text.empty()) {
      const ssize_t written = ::write(descriptor_, text.data(), text.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail(target_, errno, remedy_);
      text.remove_prefix(static_cast<std::size_t>(written));
    }
    if (::fsync(descriptor_) != 0) fail(target_, errno, remedy_);
  }

  void become_target() {
    struct stat before {};
    if (::stat(target_.c_str(), &before) == 0) ::fchmod(descriptor_, before.st_mode & 07777);
    if (::rename(path_.c_str(), target_.c_str()) != 0) fail(target_, errno, remedy_);
    moved_ = true;
  }

 private:
  const fs::path path_;
  const fs::path& target_;
  const std::string_view remedy_;
  int descriptor_;
  bool moved_ = false;
};

/// Makes a hard link to the old file, or a copy where hard links are not supported.
void keep(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) return;
  fs::path kept = file;
  kept += ".bak";
  fs::remove(kept, error);
  fs::create_hard_link(file, kept, error);
  if (error) fs::copy_file(file, kept, fs::copy_options::overwrite_existing, error);
  if (error) fail(file, error.value(), beside_the_scene);
}

/// Syncs the folder, so that names survive a power cut.
void sync_folder(const fs::path& folder) {
  const int descriptor =
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

}  // namespace

void replace_file(const fs::path& file, std::string_view text) {
  NewFile fresh(file, beside_the_scene);
  fresh.write(text);
  keep(file);
  fresh.become_target();
  sync_folder(file.parent_path());
}

void overwrite_file(const fs::path& file, std::string_view content, std::string_view remedy) {
  NewFile fresh(file, remedy);
  fresh.write(content);
  fresh.become_target();
  sync_folder(file.parent_path());
}

}  // namespace catgs
