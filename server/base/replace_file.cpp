#include "server/base/replace_file.h"

#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace catgs {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& file, int error, std::string_view remedy) {
  const bool read_only = error == EACCES || error == EPERM || error == EROFS;
  throw InputError(file.filename().string(), {},
                   read_only
                       ? "the folder is read-only for the server"
                       : fmt::format("cannot be written: {}",
                                     std::error_code(error, std::generic_category()).message()),
                   remedy);
}

NewFile new_file(const fs::path& target, std::string_view remedy) {
  try {
    return NewFile(target);
  } catch (const std::system_error& failure) {
    fail(target, failure.code().value(), remedy);
  }
}

void write(int descriptor, std::string_view content, const fs::path& target,
           std::string_view remedy) {
  while (!content.empty()) {
    const ssize_t written = ::write(descriptor, content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail(target, errno, remedy);
    content.remove_prefix(static_cast<std::size_t>(written));
  }
  if (::fsync(descriptor) != 0) fail(target, errno, remedy);
}

/// Makes a hard link to the old file, or a copy where hard links are not supported.
void keep(const fs::path& file, std::string_view remedy) {
  std::error_code error;
  if (!fs::exists(file, error)) return;
  fs::path kept = file;
  kept += ".bak";
  fs::remove(kept, error);
  fs::create_hard_link(file, kept, error);
  if (error) fs::copy_file(file, kept, fs::copy_options::overwrite_existing, error);
  if (error) fail(file, error.value(), remedy);
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

Replacement::Replacement(const fs::path& file, std::string_view content, std::string_view remedy)
    : file_(file), remedy_(remedy), fresh_(new_file(file, remedy)) {
  if (std::error_code error; fs::is_directory(file, error))
    throw InputError(file.filename().string(), {}, "is a folder", "have the folder removed");
  write(fresh_.descriptor(), content, file_, remedy_);
}

void Replacement::take_place() {
  struct stat before {};
  if (::stat(file_.c_str(), &before) == 0) ::fchmod(fresh_.descriptor(), before.st_mode & 07777);
  try {
    fresh_.become_target();
  } catch (const std::system_error& failure) {
    fail(file_, failure.code().value(), remedy_);
  }
  sync_folder(file_.parent_path());
}

void Replacement::take_place_and_keep_old() {
  keep(file_, remedy_);
  take_place();
}

void overwrite_file(const fs::path& file, std::string_view content, std::string_view remedy) {
  Replacement(file, content, remedy).take_place();
}

FileLock lock_for_saving(const fs::path& folder, std::chrono::milliseconds patience,
                         const std::function<bool()>& is_needed) {
  const fs::path lock = folder / ".catgs-lock";
  try {
    return FileLock(lock, patience, is_needed);
  } catch (const std::system_error& failure) {
    if (failure.code() == std::errc::resource_unavailable_try_again)
      throw FolderBusy("", "", "another server saves in this folder", "try again in a moment");
    fail(lock, failure.code().value(), beside_the_scene);
  }
}

}  // namespace catgs
