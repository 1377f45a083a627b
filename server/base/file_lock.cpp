#include "server/base/file_lock.h"

#include <cerrno>
#include <string>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include "render_core/base/error.h"
#include "render_core/base/new_file.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds poll_interval{5};

/// Opens no pipe that waits for a writer, and follows no link. A file of another user can be locked
/// by who may only read it, except on network file systems.
int open_lock(const fs::path& file) {
  constexpr int flags = O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
  int descriptor = ::open(file.c_str(), O_RDWR | flags, 0666);
  if (descriptor < 0 && errno == EACCES) descriptor = ::open(file.c_str(), O_RDONLY | flags, 0666);
  if (descriptor < 0) throw std::system_error(errno, std::generic_category());
  return descriptor;
}

}  // namespace

FileLock::FileLock(const fs::path& file, std::chrono::milliseconds patience,
                   const std::function<bool()>& is_needed)
    : descriptor_(open_lock(file)) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
    const int error = errno;
    if (error == EINTR) continue;
    const bool waits = std::chrono::steady_clock::now() < end && is_needed();
    if (error != EWOULDBLOCK || !waits) {
      ::close(descriptor_);
      throw std::system_error(error, std::generic_category());
    }
    std::this_thread::sleep_for(poll_interval);
  }
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

FileLock own_folder(std::string_view setting, const fs::path& folder, std::string_view name) {
  const auto refuse = [&](const std::string& why, std::string_view remedy) {
    throw InputError(std::string(setting) + " " + folder.string(), {}, why, remedy);
  };
  constexpr std::string_view writable = "name a folder that the server may write";
  std::error_code error;
  fs::create_directories(folder, error);
  if (error && !fs::is_directory(folder)) refuse(error.message(), writable);
  try {
    NewFile(folder / name);  // a lock that is there already says nothing about the folder
  } catch (const std::system_error& failure) {
    refuse("cannot be written: " + failure.code().message(), writable);
  }
  try {
    FileLock lock(folder / name);
    remove_stale_files(folder, std::chrono::hours{0});
    return lock;
  } catch (const std::system_error& failure) {
    if (failure.code() == std::errc::resource_unavailable_try_again)
      refuse("belongs to another server that runs", "give each server a folder of its own");
    refuse(fmt::format("its file {} cannot be locked: {}", name, failure.code().message()),
           "remove that file: the server makes it anew");
    throw;
  }
}

}  // namespace catgs
