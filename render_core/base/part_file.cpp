#include "render_core/base/part_file.h"

#include <string_view>
#include <system_error>

#include "render_core/base/error.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& path, std::string_view why,
                       std::string_view remedy = "does the folder exist, and is there space?") {
  throw InputError(path.string(), "", why, remedy);
}

/// Neither a file nor a folder: a pipe or a device, which must not be replaced by a file.
bool is_special(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

/// The target of a symbolic link, so that the link itself survives.
fs::path without_links(const fs::path& path) {
  std::error_code error;
  fs::path target = fs::canonical(path, error);
  return error ? path : target;
}

}  // namespace

PartFile::PartFile(const fs::path& path, Special special) : path_(path) {
  const fs::path target = special == Special::written ? without_links(path) : path;
  std::error_code error;
  if (fs::is_directory(target, error))
    fail(path_, "is a folder", "name a file, or remove the folder");
  try {
    if (special == Special::replaced || !is_special(target)) fresh_.emplace(target);
  } catch (const std::system_error& failure) {
    fail(path_, "cannot be written: " + failure.code().message());
  }
  file_.open(fresh_ ? fresh_->path() : target, std::ios::binary | std::ios::trunc);
  if (!file_) fail(path_, "cannot be written");
}

void PartFile::finish() {
  file_.close();
  if (!file_) fail(path_, "cannot be written");
  try {
    if (fresh_) fresh_->become_target();
  } catch (const std::system_error& failure) {
    fail(path_, failure.code().message());
  }
  fresh_.reset();
}

void check_writable(const fs::path& path) {
  if (!is_special(path)) PartFile{path};  // opening a pipe would wait for its reader
}

}  // namespace catgs
