#include "render_core/base/new_file.h"

#include <array>
#include <cerrno>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <stdio.h>
#include <sys/random.h>
#include <unistd.h>

namespace catgs {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t random_digits = 16;
constexpr std::string_view extension = ".new";
constexpr std::string_view hex = "0123456789abcdef";

[[noreturn]] void fail(int error) { throw std::system_error(error, std::generic_category()); }

/// ".NAME.3f0c91d29b1deb4d.new" beside NAME. It is hidden, so that no one takes it for a scene's
/// file.
fs::path random_name_beside(const fs::path& target) {
  constexpr std::size_t most_bytes = 200;  // of NAME: file systems take 255
  std::array<unsigned char, random_digits> random{};
  if (::getrandom(random.data(), random.size(), 0) != static_cast<ssize_t>(random.size()))
    fail(errno);
  std::string name = ".";
  name.append(target.filename().string().substr(0, most_bytes)).append(".");
  for (const unsigned char byte : random) name += hex[byte % hex.size()];
  return target.parent_path() / name.append(extension);
}

}  // namespace

NewFile::NewFile(fs::path target) : target_(std::move(target)), name_(random_name_beside(target_)) {
  const fs::path folder = target_.parent_path();
  descriptor_ = ::open(folder.empty() ? "." : folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0666);
  if (descriptor_ >= 0) return;
  descriptor_ = ::open(name_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor_ < 0) fail(errno);
  named_ = true;
}

NewFile::~NewFile() {
  ::close(descriptor_);
  if (named_) ::unlink(name_.c_str());
}

fs::path NewFile::path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

void NewFile::become_target() {
  // linkat() replaces nothing, so the file gets a name of its own first.
  if (!named_ &&
      ::linkat(AT_FDCWD, path().c_str(), AT_FDCWD, name_.c_str(), AT_SYMLINK_FOLLOW) != 0)
    fail(errno);
  named_ = true;
  if (::rename(name_.c_str(), target_.c_str()) != 0) fail(errno);
  named_ = false;
}

bool is_name_of_new_file(const fs::path& file) {
  const std::string name = file.filename().string();
  if (!name.starts_with('.') || !name.ends_with(extension)) return false;
  const std::size_t digits_end = name.size() - extension.size();
  const std::size_t dot = name.rfind('.', digits_end - 1);
  return dot > 0 && digits_end - dot - 1 == random_digits &&
         name.find_first_not_of(hex, dot + 1) == digits_end;
}

void remove_stale_files(const fs::path& folder, std::chrono::hours unchanged_for) {
  const auto now = fs::file_time_type::clock::now();
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (!is_name_of_new_file(entry->path())) continue;
    std::error_code gone;
    const bool is_file = fs::is_regular_file(entry->symlink_status(gone));
    const auto written = entry->last_write_time(gone);
    if (is_file && !gone && now - written >= unchanged_for) fs::remove(entry->path(), gone);
  }
}

}  // namespace catgs
